// Steps back and forward: what was chosen before each change.

const MOST = 100, PAUSE = 1000; // steps; milliseconds

export class Steps {
	// now(): what is chosen; go(then): it is chosen again
	constructor(back, forward, now, go) {
		Object.assign(this, {buttons: {past: back, future: forward}, now, go, past: [], future: [], recent: {}});
		back.onclick = () => this.back();
		forward.onclick = () => this.forward();
	}

	before(name, value, live) { // a change of a value; a drag is one step back, and what is typed without a pause
		const {recent} = this, time = performance.now();
		const goes = recent.name === name && (typeof value === "object" ? recent.live : time - recent.time < PAUSE);
		if (!goes) this.remember();
		this.recent = {name, time, live};
	}

	remember() {
		const now = JSON.stringify(this.now());
		if (this.past.at(-1) === now) return;
		this.take([...this.past, now].slice(-MOST), []);
	}

	back() { this.travel(this.past, this.future); }
	forward() { this.travel(this.future, this.past); }

	travel(from, to) {
		if (!from.length) return;
		this.recent = {};
		to.push(JSON.stringify(this.now()));
		const then = JSON.parse(from.pop());
		this.take(this.past, this.future);
		this.go(then);
	}

	take(past, future) {
		Object.assign(this, {past, future});
		for (const [way, button] of Object.entries(this.buttons)) button.disabled = !this[way].length;
	}
}
