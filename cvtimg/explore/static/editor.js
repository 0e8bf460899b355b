// Changes by hand on the picture: segments are merged and split by clicks; brushes paint, add and erase.

const BRUSHES = ["paint", "add", "erase"];
const COLORS = {paint: "#0b5fc4", add: "#0a7d3c", erase: "#b8330a", merge: "#0b5fc4"};

export class Editor {
	// strokes(): changes so far, as texts; done(text): a change is made
	constructor(viewer, strokes, done) {
		Object.assign(this, {viewer, strokes, done, layer: document.createElement("canvas"), control: null, mode: "", radius: 12, points: [], anchor: null, cursor: null});
	}

	get label() { return "Image: arrows move the cursor, Enter applies what is chosen, Escape ends"; }
	get brushes() { return BRUSHES.includes(this.mode); }

	is(control, mode = this.mode) { return Boolean(this.mode) && this.control?.name === control.name && this.mode === mode; }

	start(control, mode) {
		Object.assign(this, {control, mode, points: [], anchor: null});
		const {width, height} = this.viewer.box();
		this.cursor = mode ? this.pixel(width / 2, height / 2) : null;
		this.viewer.place();
	}

	pixel(px, py) { // also beside the picture
		const {x, y, zoom} = this.viewer.view;
		return [Math.floor((px - x) / zoom), Math.floor((py - y) / zoom)];
	}

	inside([x, y]) { const {width, height} = this.viewer.size; return x >= 0 && y >= 0 && x < width && y < height; }

	finish() {
		const {mode, points} = this, written = points.map(point => point.join(",")).join(" ");
		this.points = [];
		if (!points.length) return;
		if (this.brushes) this.done(`${mode} ${this.radius} ${written}`);
		else if (!this.inside(points[0])) return;
		else if (mode === "split") this.done(`split ${points[0].join(",")}`);
		else if (points.length > 1) this.done(`merge ${written}`);
		else if (this.anchor) this.done(`merge ${this.anchor.join(",")} ${written}`);
		else this.anchor = points[0];
		this.viewer.place();
	}

	down(px, py) {
		this.points = [this.pixel(px, py)];
		this.viewer.drawTool();
		return true;
	}

	move(px, py) {
		const at = this.cursor = this.pixel(px, py), last = this.points.at(-1);
		const apart = this.brushes ? Math.max(1, this.radius / 3) : 4 / this.viewer.view.zoom;
		if (last && this.mode !== "split" && Math.hypot(at[0] - last[0], at[1] - last[1]) >= apart) this.points.push(at);
		this.viewer.drawTool();
	}

	up() { this.finish(); }

	key(event) {
		const by = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}[event.key], far = event.shiftKey ? 20 : 2;
		if (by) this.cursor = this.cursor.map((value, axis) => value + by[axis] * far);
		else if (event.key === "Enter") { this.points = [this.cursor]; this.finish(); } else return false;
		this.viewer.drawTool();
		return true;
	}

	draw(context, width, height) {
		const {x, y, zoom} = this.viewer.view, at = point => [x + (point[0] + .5) * zoom, y + (point[1] + .5) * zoom];
		const line = (points, width, context) => {
			context.lineWidth = width;
			context.lineCap = context.lineJoin = "round";
			context.beginPath();
			context.moveTo(...at(points[0]));
			for (const point of points.length > 1 ? points.slice(1) : points) context.lineTo(...at(point));
			context.stroke();
		};
		Object.assign(this.layer, {width, height});
		const layer = this.layer.getContext("2d"), {values, base} = this.control ?? {};
		const stroke = (kind, radius, points) => {
			layer.globalCompositeOperation = values && values[kind] === base ? "destination-out" : "source-over";
			layer.strokeStyle = COLORS[kind];
			line(points, this.brushes ? 2 * radius * zoom : 4, layer);
		};
		if (values) { // a map is seen; changes of segments are seen in the result
			for (const [kind, radius, ...points] of this.strokes().map(text => text.split(" "))) stroke(kind, radius, points.map(point => point.split(",").map(Number)));
		}
		if (this.points.length) stroke(this.mode, this.radius, this.points);
		context.globalAlpha = .55;
		context.drawImage(this.layer, 0, 0);
		context.globalAlpha = 1;
		if (this.anchor) this.ring(context, at(this.anchor), 6);
		if (this.cursor && this.mode) this.ring(context, at(this.cursor), this.brushes ? this.radius * zoom : 9);
	}

	ring(context, [x, y], radius) {
		for (const [color, width] of [["#000", 3.5], ["#fff", 1.5]]) {
			context.strokeStyle = color;
			context.lineWidth = width;
			context.beginPath();
			context.arc(x, y, Math.max(radius, 2), 0, 7);
			context.stroke();
		}
	}
}
