// Requests to the server, all with the session that the entrance gives.
// The socket: requests carry numbers, and replies to requests that are no longer wanted are dropped.
// Three lanes: "draft" while a control moves, "exact" when it rests, "before" for the picture itself.

const given = location.hash.match(/^#session=(.+)/);
if (given) { sessionStorage.session = given[1]; history.replaceState(null, "", "/"); }
let session = sessionStorage.session ?? "none";

// Another tab of this browser, on the same server, lets this one in.
const tabs = new BroadcastChannel("session");
tabs.onmessage = ({data}) => { if (data === "asked" && session !== "none") tabs.postMessage({session}); };
export const admitted = session !== "none" ? Promise.resolve(true) : new Promise(done => {
	tabs.addEventListener("message", ({data}) => { if (data.session) { session = sessionStorage.session = data.session; done(true); } });
	tabs.postMessage("asked");
	setTimeout(done, 400, false);
});

export async function get(address, body) {
	const answer = await fetch(address, {method: body === undefined ? "GET" : "POST", body, headers: {"x-cvtimg-session": session}});
	if (!answer.ok) throw new Error(await answer.text());
	return answer;
}
// Returns the size of a file, which the server makes if it has to, 0 where it cannot; and how alike to the image it looks.
export async function weight(address) {
	const answer = await fetch(address, {method: "HEAD", headers: {"x-cvtimg-session": session}});
	return {bytes: answer.ok ? Number(answer.headers.get("content-length")) : 0, quality: answer.headers.get("x-quality")};
}
export const send = async (address, body = "") => (await get(address, body)).json();

export class Link {
	constructor(receive, lost, back) {
		Object.assign(this, {receive, lost, back, seq: 0, newest: 0, gone: false, sent: new Map(), drafting: 0, next: null}); // newest: of drafts and results
		this.connect();
	}

	async connect() {
		if (!await admitted) return;
		this.socket = new WebSocket(`ws://${location.host}/live`, ["cvtimg", session]);
		this.socket.binaryType = "arraybuffer";
		this.ready = new Promise(done => { this.socket.onopen = () => { done(); if (this.gone) { this.gone = false; this.back(); } }; });
		this.socket.onmessage = event => this.take(event.data);
		this.socket.onclose = () => { // a machine that slept, or a server that ended
			if (!this.gone) { this.gone = true; this.sent.clear(); this.drafting = 0; this.next = null; this.lost(); }
			setTimeout(() => this.connect(), 1500);
		};
	}

	cancel() { this.ask("cancel", {}); }

	async ask(lane, request, about = {}) {
		if (this.gone || !this.socket) return;
		if (lane === "draft" && this.drafting) { this.next = [lane, request, about]; return; } // else they are painted late, one after the other
		if (lane === "exact") this.goOn();
		const seq = ++this.seq;
		if (lane === "draft") this.drafting = seq;
		if (lane !== "before") this.newest = seq;
		if (lane === "cancel") this.lastShown = seq; // older drafts come too late
		this.sent.set(seq, {lane, request, ...about});
		for (const old of this.sent.keys()) if (old < seq - 300) this.sent.delete(old);
		if (this.socket.readyState !== WebSocket.OPEN) await this.ready;
		this.socket.send(JSON.stringify({seq, lane, ...request}));
		return seq;
	}

	goOn() { // with the newest of the drafts that waited
		const {next} = this;
		Object.assign(this, {drafting: 0, next: null});
		if (next) this.ask(...next);
	}

	take(data) {
		const reply = typeof data === "string" ? JSON.parse(data) : unpacked(data);
		const asked = this.sent.get(reply.seq);
		if (reply.seq === this.drafting && reply.share === undefined) requestAnimationFrame(() => { if (reply.seq === this.drafting) this.goOn(); });
		if (!asked) { if (reply.error) this.receive(reply, {}); return; }
		// A result is wanted only for the settings that are shown; of drafts the newest so far.
		if (asked.lane === "exact" && reply.seq !== this.newest) return;
		if (asked.lane === "draft" && reply.seq < (this.lastShown || 0)) return;
		if (asked.lane === "draft" && reply.error !== undefined) return; // the result tells why, if it has none either
		if (asked.lane !== "before" && reply.share === undefined) this.lastShown = reply.seq;
		this.receive(reply, asked);
	}
}

// u32 number | u32 length | JSON | palette (RGBA), indices; or pixels (RGBA); or SVG
function unpacked(buffer) {
	const view = new DataView(buffer), seq = view.getUint32(0, true), length = view.getUint32(4, true);
	const reply = {seq, ...JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)))};
	const start = 8 + length;
	if (reply.kind === "indexed") {
		reply.palette = new Uint32Array(buffer, start, reply.colors);
		const Kind = {1: Uint8Array, 2: Uint16Array, 4: Uint32Array}[reply.size];
		reply.indices = new Kind(buffer, start + 4 * reply.colors, reply.width * reply.height);
	} else if (reply.kind === "globe") {
		reply.vertices = new Float32Array(buffer, start, 3 * reply.corners);
		reply.edges = new Uint32Array(buffer, start + 12 * reply.corners);
	} else if (reply.kind === "pixels") reply.pixels = new Uint8ClampedArray(buffer, start);
	else if (reply.kind === "svg") reply.svg = new Blob([new Uint8Array(buffer, start)], {type: "image/svg+xml"});
	return reply;
}
