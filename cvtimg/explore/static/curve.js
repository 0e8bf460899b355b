// The energy for each number of colors, on logarithmic axes, with the elbow and a marker to drag.

const NS = "http://www.w3.org/2000/svg", LEFT = 14, WIDTH = 292, TOP = 10, HEIGHT = 116, LAST = 64;
const X = k => LEFT + Math.log(k) / Math.log(LAST) * WIDTH;

export class Curve {
	// chosen(k, live)
	constructor(svg, chosen) {
		this.svg = svg;
		this.chosen = chosen;
		const toK = event => {
			const box = svg.getBoundingClientRect();
			const k = Math.exp(((event.clientX - box.left) / box.width * 320 - LEFT) / WIDTH * Math.log(LAST));
			return Math.min(this.last, Math.max(1, Math.round(k)));
		};
		svg.addEventListener("pointerdown", event => { if (this.curve) { svg.setPointerCapture(event.pointerId); chosen(toK(event), true); } });
		svg.addEventListener("pointermove", event => { if (this.curve && event.buttons & 1) chosen(toK(event), true); });
		svg.addEventListener("pointerup", event => { if (this.curve) chosen(toK(event), false); });
		svg.addEventListener("keydown", event => {
			const by = {ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -8, PageUp: 8}[event.key];
			const to = event.key === "Enter" ? this.curve?.elbow : by && this.k + by;
			if (!to || !this.curve) return;
			event.preventDefault();
			chosen(Math.min(this.last, Math.max(1, to)), false);
		});
	}

	get last() { return this.curve.heights.length; }

	add(name, attributes, text) {
		const made = document.createElementNS(NS, name);
		for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
		if (text !== undefined) made.textContent = text;
		this.svg.append(made);
		return made;
	}

	set(curve) {
		this.curve = curve;
		const focused = this.marker === document.activeElement;
		this.svg.replaceChildren();
		for (const k of [1, 2, 4, 8, 16, 32, 64]) {
			this.add("line", {class: "axis", x1: X(k), x2: X(k), y1: TOP, y2: TOP + HEIGHT});
			this.add("text", {x: X(k), y: TOP + HEIGHT + 14, "text-anchor": "middle"}, k);
		}
		if (!curve) { this.add("text", {x: 160, y: 70, "text-anchor": "middle"}, "computing the curve…"); this.marker = null; return; }
		const logs = curve.heights.map(Math.log), low = Math.min(...logs, -1e-9);
		this.Y = k => TOP + logs[k - 1] / low * HEIGHT;
		this.add("path", {class: "line", d: logs.map((_, i) => `${i ? "L" : "M"}${X(i + 1).toFixed(1)} ${this.Y(i + 1).toFixed(1)}`).join("")});
		this.add("circle", {class: "elbow", cx: X(curve.elbow), cy: this.Y(curve.elbow), r: 8});
		this.add("text", {class: "elbowname", x: X(curve.elbow) + 11, y: this.Y(curve.elbow) - 7}, `elbow ${curve.elbow}`);
		this.marker = this.add("circle", {class: "marker", r: 6, tabindex: 0, role: "slider", "aria-label": "Number of colors on the curve; Enter takes the elbow", "aria-valuemin": 1, "aria-valuemax": this.last});
		this.mark(this.k);
		if (focused) this.marker.focus();
	}

	mark(k) {
		this.k = k;
		if (!this.marker || !k) return;
		const on = Math.min(Math.max(k, 1), this.last), quality = this.curve.psnr?.[on - 1];
		this.marker.setAttribute("cx", X(on));
		this.marker.setAttribute("cy", this.Y(on));
		this.marker.ariaValueNow = k;
		this.marker.ariaValueText = `${k} colors${quality && k <= this.last ? `, ${quality} dB` : ""}`;
	}
}
