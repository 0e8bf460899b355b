// Two panes that show the same part of the picture: the left one what is compared with, the right one the result.
// Each has a whole picture and a patch of finer pixels over it; both move and zoom together.

const $ = id => document.getElementById(id);
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

export class Pane {
	constructor(element) {
		this.element = element;
		this.world = element.querySelector(".world");
		[this.under, this.whole, this.patch] = [1, 2, 3].map(() => this.world.appendChild(document.createElement("canvas")));
		this.drawing = this.world.appendChild(new Image());
		this.drawing.alt = "";
		this.clear();
	}

	clear() {
		this.reply = null;
		for (const part of [this.under, this.whole, this.patch, this.drawing]) part.hidden = true;
	}

	// look: {spot, lines, fill}; under: a reply with the picture itself, for what is drawn over it
	show(reply, size, look = {}, under = null) {
		this.reply = reply;
		place(this.world, 0, 0, size.width, size.height);
		this.drawing.hidden = reply.kind !== "svg";
		this.drawing.classList.toggle("paper", !reply.over);
		const over = (reply.kind === "svg" && reply.over) || (reply.kind === "indexed" && look.lines && !look.fill);
		const [left, top, right, bottom] = reply.window;
		const all = reply.kind === "svg" || (left <= 0 && top <= 0 && right >= size.width && bottom >= size.height);
		this.under.hidden = !(under && (over || (!all && this.whole.hidden))); // the picture, around a part of the result
		if (!this.under.hidden) paint(this.under, under, {});
		if (reply.kind === "svg") {
			this.whole.hidden = this.patch.hidden = true;
			const old = this.drawing.src;
			this.drawing.src = URL.createObjectURL(reply.svg);
			place(this.drawing, 0, 0, size.width, size.height);
			if (old) URL.revokeObjectURL(old);
			return this.drawing.decode().catch(() => {});
		}
		const canvas = all ? this.whole : this.patch;
		canvas.hidden = false;
		if (all) this.patch.hidden = true;
		paint(canvas, reply, look);
	}
}

function place(element, left, top, width, height) {
	for (const [name, value] of Object.entries({left, top, width, height})) element.style[name] = value + "px";
}

// Dimmed colors keep a fifth of their contrast, so that one color is found at a glance.
const dim = c => (((c >>> 16 & 255) * .2 + 44) << 16 | ((c >>> 8 & 255) * .2 + 44) << 8 | ((c & 255) * .2 + 44) | c & 0xff000000) >>> 0;

function paint(canvas, reply, look) {
	const {width, height, window: [left, top, , , step]} = reply;
	if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
	canvas.hidden = false;
	place(canvas, left, top, width * step, height * step);
	const context = canvas.getContext("2d");
	if (reply.kind === "pixels") { context.putImageData(new ImageData(reply.pixels, width, height), 0, 0); return; }
	const image = context.createImageData(width, height), out = new Uint32Array(image.data.buffer), {indices} = reply;
	let table = reply.palette;
	if (look.lines && !look.fill) table = table.map(() => 0);
	if (look.spot >= 0 && look.spot < table.length) table = reply.palette.map((c, i) => i === look.spot ? c : dim(c));
	for (let i = 0; i < indices.length; i++) out[i] = table[indices[i]];
	if (look.lines) {
		for (let y = 0, i = 0; y < height; y++) {
			for (let x = 0; x < width; x++, i++) {
				const one = indices[i];
				if ((x + 1 < width && indices[i + 1] !== one) || (y + 1 < height && indices[i + width] !== one)) out[i] = 0xff00ffff;
			}
		}
	}
	context.putImageData(image, 0, 0);
}

export class Viewer {
	constructor({moved, picked}) {
		this.stage = $("stage");
		this.left = new Pane($("left"));
		this.right = new Pane($("right"));
		this.view = {x: 0, y: 0, zoom: 1};
		this.split = .5;
		this.size = null;
		this.moved = moved;
		this.picked = picked;
		this.cross = {x: 0, y: 0};
		this.listen();
		this.tool = null; // takes pointer and keys before the viewer does, and draws over the panes
		this.overlay = $("overlay");
		new ResizeObserver(() => this.place()).observe(this.stage);
	}

	get mode() { return this.stage.classList.contains("alone") ? "result" : $("mode").value; }
	set mode(mode) { $("mode").value = mode; this.place(); this.moved(); }
	get picking() { return this.stage.classList.contains("picking"); }
	set picking(on) {
		this.stage.classList.toggle("picking", on);
		$("cross").hidden = !on;
		const box = this.box();
		this.cross = {x: box.width / 2, y: box.height / 2};
		this.place();
	}

	box() { // of a pane, in pixels of the screen
		const {left, top, width, height} = this.stage.getBoundingClientRect();
		return {left, top, width: this.mode === "beside" ? width / 2 : width, height};
	}

	place() {
		if (!this.size) return;
		const {x, y, zoom} = this.view, box = this.box();
		this.stage.classList.toggle("beside", this.mode === "beside");
		this.stage.classList.toggle("result", this.mode === "result");
		this.stage.classList.toggle("pixels", zoom >= 2);
		for (const pane of [this.left, this.right]) pane.world.style.transform = `translate(${x}px,${y}px) scale(${zoom})`;
		const at = this.split * box.width;
		this.right.element.style.clipPath = this.mode === "divider" ? `inset(0 0 0 ${this.peek ? box.width : at}px)` : this.peek ? "inset(0 0 0 100%)" : "";
		this.left.element.style.clipPath = this.mode === "divider" && !this.peek ? `inset(0 ${box.width - at}px 0 0)` : "";
		this.left.element.style.display = this.peek ? "block" : "";
		$("divider").style.left = at + "px";
		$("divider").ariaValueNow = Math.round(this.split * 100);
		$("zoom").textContent = (zoom < .1 ? (zoom * 100).toFixed(1) : Math.round(zoom * 100)) + " %";
		$("cross").style.left = this.cross.x + "px";
		$("cross").style.top = this.cross.y + "px";
		this.drawTool();
	}

	drawTool() {
		const {overlay, tool} = this, {width, height} = this.stage.getBoundingClientRect(), fine = devicePixelRatio;
		overlay.hidden = !tool;
		if (!tool) return;
		const context = overlay.getContext("2d"), size = [Math.round(width * fine), Math.round(height * fine)];
		if (overlay.width !== size[0] || overlay.height !== size[1]) [overlay.width, overlay.height] = size;
		context.setTransform(fine, 0, 0, fine, 0, 0);
		context.clearRect(0, 0, width, height);
		const box = this.box();
		for (let left = 0; left < width - 1; left += box.width) { // once for each pane
			context.save();
			context.beginPath();
			context.rect(left, 0, box.width, height);
			context.clip();
			context.translate(left, 0);
			tool.draw(context, box.width, height);
			context.restore();
		}
	}

	visible() { // the part of the picture that is seen: left, top, right, bottom
		const {x, y, zoom} = this.view, {width, height} = this.box();
		return [-x / zoom, -y / zoom, (width - x) / zoom, (height - y) / zoom].map(value => Math.round(value * 10) / 10);
	}

	fit() {
		const {width, height} = this.box(), margin = 12;
		const zoom = Math.min((width - margin) / this.size.width, (height - margin) / this.size.height, 16);
		this.view = {zoom, x: (width - this.size.width * zoom) / 2, y: (height - this.size.height * zoom) / 2};
		this.changed();
	}

	zoomTo(zoom, px, py) {
		const {width, height} = this.box(), v = this.view;
		px ??= width / 2; py ??= height / 2;
		zoom = clamp(zoom, .01, 64);
		this.view = {zoom, x: px - (px - v.x) * zoom / v.zoom, y: py - (py - v.y) * zoom / v.zoom};
		this.changed();
	}

	pan(dx, dy) { this.view.x += dx; this.view.y += dy; this.changed(); }

	changed() {
		const {width, height} = this.box(), v = this.view, keep = 40; // some of the picture stays in sight
		v.x = clamp(v.x, keep - this.size.width * v.zoom, width - keep);
		v.y = clamp(v.y, keep - this.size.height * v.zoom, height - keep);
		this.place();
		this.moved();
	}

	divide(split) { this.split = clamp(split, 0, 1); this.place(); }

	pixelAt(px, py) {
		const x = Math.floor((px - this.view.x) / this.view.zoom), y = Math.floor((py - this.view.y) / this.view.zoom);
		return x >= 0 && y >= 0 && x < this.size.width && y < this.size.height ? {x, y} : null;
	}

	at(event) { // in a pane
		const box = this.box(), x = event.clientX - box.left;
		return [this.mode === "beside" ? x % box.width : x, event.clientY - box.top];
	}

	listen() {
		const fingers = new Map();
		let travelled = 0, apart = 0, taken = false;
		this.stage.addEventListener("pointerdown", event => {
			if (!this.size || event.target.closest("#divider")) return;
			this.stage.setPointerCapture(event.pointerId);
			fingers.set(event.pointerId, event);
			travelled = 0;
			if (fingers.size === 1 && event.button === 0) taken = Boolean(this.tool?.down?.(...this.at(event), event));
		});
		this.stage.addEventListener("pointermove", event => {
			const before = fingers.get(event.pointerId);
			if (!before || (taken && fingers.size === 1)) this.tool?.move?.(...this.at(event), event);
			if (!before) return;
			fingers.set(event.pointerId, event);
			travelled += Math.hypot(event.clientX - before.clientX, event.clientY - before.clientY);
			if (fingers.size === 2) {
				const [a, b] = [...fingers.values()], now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
				const [px, py] = this.at({clientX: (a.clientX + b.clientX) / 2, clientY: (a.clientY + b.clientY) / 2});
				if (apart) this.zoomTo(this.view.zoom * now / apart, px, py);
				apart = now;
			} else if (!taken) this.pan(event.clientX - before.clientX, event.clientY - before.clientY);
		});
		const end = event => {
			if (fingers.delete(event.pointerId) && event.type === "pointerup" && travelled < 4 && this.picking) {
				const pixel = this.pixelAt(...this.at(event));
				if (pixel) this.picked(pixel);
			}
			if (taken && !fingers.size) { taken = false; this.tool?.up?.(...this.at(event), event); }
			apart = 0;
		};
		this.stage.addEventListener("pointerup", end);
		this.stage.addEventListener("pointercancel", end);
		this.stage.addEventListener("wheel", event => {
			if (!this.size) return;
			event.preventDefault();
			this.zoomTo(this.view.zoom * Math.exp(-clamp(event.deltaY, -200, 200) / 400), ...this.at(event));
		}, {passive: false});
		const divider = $("divider");
		divider.addEventListener("pointerdown", event => { event.stopPropagation(); divider.setPointerCapture(event.pointerId); });
		divider.addEventListener("pointermove", event => {
			if (event.buttons & 1) this.divide((event.clientX - this.box().left) / this.box().width);
		});
		divider.addEventListener("keydown", event => {
			const by = {ArrowLeft: -.02, ArrowDown: -.02, ArrowRight: .02, ArrowUp: .02, PageDown: -.1, PageUp: .1, Home: -1, End: 1}[event.key];
			if (!by) return;
			event.preventDefault();
			event.stopPropagation();
			this.divide(this.split + by);
		});
		this.stage.addEventListener("keydown", event => {
			if (!this.size || event.ctrlKey || event.metaKey) return;
			if (this.tool?.key?.(event)) { event.preventDefault(); return; }
			const far = event.shiftKey ? (this.picking ? 10 : 200) : this.picking ? 1 : 50;
			const way = {ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key];
			if (way && this.picking) {
				const box = this.box();
				this.cross = {x: clamp(this.cross.x - way[0] * far, 0, box.width - 1), y: clamp(this.cross.y - way[1] * far, 0, box.height - 1)};
				this.place();
			} else if (way) this.pan(way[0] * far, way[1] * far);
			else if (event.key === "Enter" && this.picking) {
				const pixel = this.pixelAt(this.cross.x, this.cross.y);
				if (pixel) this.picked(pixel);
			} else return;
			event.preventDefault();
		});
		$("fit").onclick = () => this.size && this.fit();
		$("one").onclick = () => this.size && this.zoomTo(1);
		$("in").onclick = () => this.size && this.zoomTo(this.view.zoom * 2);
		$("out").onclick = () => this.size && this.zoomTo(this.view.zoom / 2);
		$("mode").onchange = () => { this.place(); this.moved(); };
	}
}
