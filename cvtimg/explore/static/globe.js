// A globe that turns: cells of a grid over land and sea, with circles of finer cells that are added, moved and resized.

const EARTH = 6371.229, MOST_BASE = 250_000, MANY = 60_000;
const SEA = [218, 229, 239], LAND = [203, 208, 184];
const radians = degrees => degrees * Math.PI / 180, degrees = angle => angle * 180 / Math.PI;
const toVector = (lon, lat) => [Math.cos(radians(lat)) * Math.cos(radians(lon)), Math.cos(radians(lat)) * Math.sin(radians(lon)), Math.sin(radians(lat))];
const toPlace = ([x, y, z]) => [degrees(Math.atan2(y, x)), degrees(Math.asin(Math.max(-1, Math.min(1, z))))].map(value => Math.round(value * 10) / 10);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

export class Globe {
	// rows(): the table of circles {columns, rows}; changed(rows, live)
	constructor(viewer, rows, changed) {
		Object.assign(this, {viewer, rows, changed, lon: 10, lat: 35, grid: null, held: null, land: null});
		const map = new Image();
		map.onload = () => {
			const canvas = new OffscreenCanvas(map.width, map.height), context = canvas.getContext("2d");
			context.drawImage(map, 0, 0);
			const {data} = context.getImageData(0, 0, map.width, map.height);
			this.land = {width: map.width, height: map.height, is: Uint8Array.from({length: data.length / 4}, (_, i) => data[4 * i] > 127)};
			viewer.place();
		};
		map.src = "/land.png";
		this.base = document.createElement("canvas");
	}

	get label() { return "Globe: arrows turn it, Enter adds a circle in the middle, plus and minus zoom"; }

	show(grid) { this.grid = grid; this.viewer.place(); }
	clear() { this.grid = null; this.viewer.place(); }

	// Axes of the view as rows: right, up, and toward the viewer.
	get axes() {
		const [a, b] = [radians(this.lon), radians(this.lat)];
		return [[-Math.sin(a), Math.cos(a), 0], [-Math.sin(b) * Math.cos(a), -Math.sin(b) * Math.sin(a), Math.cos(b)], toVector(this.lon, this.lat)];
	}

	get disk() { // its middle and radius on the screen
		const {x, y, zoom} = this.viewer.view;
		return {x: x + 500 * zoom, y: y + 500 * zoom, r: 480 * zoom};
	}

	onScreen(vector) { // [x, y, depth]
		const {x, y, r} = this.disk, [right, up, toward] = this.axes;
		return [x + r * dot(vector, right), y - r * dot(vector, up), dot(vector, toward)];
	}

	under(px, py) { // the place that is seen at a point of the screen, or null
		const {x, y, r} = this.disk, u = (px - x) / r, v = (y - py) / r, square = u * u + v * v;
		if (square >= 1) return null;
		const w = Math.sqrt(1 - square), [right, up, toward] = this.axes;
		return right.map((_, i) => u * right[i] + v * up[i] + w * toward[i]);
	}

	angle(row) { return this.rows().columns[2].unit === "km" ? row[2] / EARTH : radians(row[2]); }

	draw(context, width, height) {
		this.drawBase(context, width, height);
		if (this.grid) this.drawCells(context, width, height);
		for (const row of this.rows().rows) this.drawCircle(context, row);
	}

	drawBase(context, width, height) {
		const {x, y, r} = this.disk, [right, up, toward] = this.axes;
		const most = this.held ? MOST_BASE / 4 : MOST_BASE; // coarser while it turns
		const step = Math.max(1, Math.sqrt(width * height / most)), w = Math.ceil(width / step), h = Math.ceil(height / step);
		Object.assign(this.base, {width: w, height: h});
		const own = this.base.getContext("2d"), image = own.createImageData(w, h), out = image.data, {land} = this;
		for (let j = 0, at = 0; j < h; j++) {
			const v = (y - (j + .5) * step) / r;
			for (let i = 0; i < w; i++, at += 4) {
				const u = ((i + .5) * step - x) / r, square = u * u + v * v;
				if (square > 1) continue;
				const t = Math.sqrt(1 - square), shade = .72 + .28 * t;
				const p = [u * right[0] + v * up[0] + t * toward[0], u * right[1] + v * up[1] + t * toward[1], v * up[2] + t * toward[2]];
				let color = SEA;
				if (land) {
					const column = Math.floor((Math.atan2(p[1], p[0]) / Math.PI + 1) / 2 * land.width) % land.width;
					const line = Math.min(land.height - 1, Math.floor((.5 - Math.asin(p[2]) / Math.PI) * land.height));
					if (land.is[line * land.width + column]) color = LAND;
				}
				out[at] = color[0] * shade; out[at + 1] = color[1] * shade; out[at + 2] = color[2] * shade;
				out[at + 3] = 255 * Math.min(1, (1 - Math.sqrt(square)) * r / step);
			}
		}
		own.putImageData(image, 0, 0);
		context.drawImage(this.base, 0, 0, w * step, h * step);
	}

	drawCells(context, width, height) {
		const {vertices, edges} = this.grid, n = vertices.length / 3, {x, y, r} = this.disk, [right, up, toward] = this.axes;
		const places = this.places?.length === 3 * n ? this.places : this.places = new Float32Array(3 * n);
		for (let i = 0; i < 3 * n; i += 3) {
			const a = vertices[i], b = vertices[i + 1], c = vertices[i + 2];
			places[i] = x + r * (a * right[0] + b * right[1]);
			places[i + 1] = y - r * (a * up[0] + b * up[1] + c * up[2]);
			places[i + 2] = a * toward[0] + b * toward[1] + c * toward[2];
		}
		const step = this.held && edges.length > 2 * MANY ? 8 : 2; // fewer while it turns
		context.beginPath();
		for (let e = 0; e < edges.length; e += step) {
			const i = 3 * edges[e], j = 3 * edges[e + 1];
			if (places[i + 2] < 0 || places[j + 2] < 0) continue;
			if (Math.max(places[i], places[j]) < 0 || Math.min(places[i], places[j]) > width || Math.max(places[i + 1], places[j + 1]) < 0 || Math.min(places[i + 1], places[j + 1]) > height) continue;
			context.moveTo(places[i], places[i + 1]);
			context.lineTo(places[j], places[j + 1]);
		}
		context.strokeStyle = "#17345c";
		context.lineWidth = Math.max(.25, Math.min(1.1, .02 * r * Math.sqrt(12 / n) * 4));
		context.stroke();
	}

	drawCircle(context, row) {
		const middle = toVector(row[0], row[1]), angle = this.angle(row);
		const east = toVector(row[0] + 90, 0), north = toVector(row[0], row[1] + 90);
		context.beginPath();
		let down = false;
		for (let turn = 0; turn <= 120; turn++) {
			const a = turn / 60 * Math.PI, [s, c] = [Math.sin(angle), Math.cos(angle)];
			const [px, py, depth] = this.onScreen(middle.map((m, i) => c * m + s * (Math.cos(a) * east[i] + Math.sin(a) * north[i])));
			if (depth < 0) { down = false; continue; }
			if (down) context.lineTo(px, py); else context.moveTo(px, py);
			down = true;
		}
		const [px, py, depth] = this.onScreen(middle);
		if (depth > 0) { context.moveTo(px + 5, py); context.arc(px, py, 5, 0, 7); }
		for (const [color, wide] of [["#fff", 5], ["#b8330a", 2.5]]) { context.strokeStyle = color; context.lineWidth = wide; context.stroke(); }
	}

	// What a point of the screen holds: the middle or the rim of a circle.
	hit(px, py) {
		const {rows} = this.rows(), at = this.under(px, py), {r} = this.disk;
		for (let index = rows.length - 1; at && index >= 0; index--) {
			const away = Math.acos(Math.min(1, dot(at, toVector(rows[index][0], rows[index][1]))));
			if (away * r < 10) return {index, part: "middle"};
			if (Math.abs(away - this.angle(rows[index])) * r < 7) return {index, part: "rim"};
		}
		return null;
	}

	down(px, py) {
		this.held = {px, py, travelled: 0, ...this.hit(px, py)};
		return true;
	}

	move(px, py) {
		const {held} = this;
		if (!held) { this.viewer.stage.style.cursor = this.hit(px, py) ? "move" : ""; return; }
		const dx = px - held.px, dy = py - held.py, {r} = this.disk;
		Object.assign(held, {px, py, travelled: held.travelled + Math.hypot(dx, dy)});
		if (held.part && held.travelled > 3) this.drag(px, py, true);
		else if (!held.part) this.turn(-degrees(dx / r), degrees(dy / r));
	}

	up(px, py) {
		const {held} = this;
		this.held = null;
		if (held?.part && held.travelled > 3) this.drag(px, py, false, held);
		else if (held && !held.part && held.travelled < 4) this.add(this.under(px, py));
		else this.viewer.place();
	}

	drag(px, py, live, held = this.held) {
		const {rows, columns} = this.rows(), at = this.under(px, py), row = [...rows[held.index]];
		if (at && held.part === "middle") [row[0], row[1]] = toPlace(at);
		else if (at) {
			const away = Math.acos(Math.min(1, dot(at, toVector(row[0], row[1])))), {unit, low, high} = columns[2];
			row[2] = Math.min(high, Math.max(low, unit === "km" ? Math.round(away * EARTH / 10) * 10 : Math.round(degrees(away) * 10) / 10));
		}
		this.changed(rows.map((one, index) => index === held.index ? row : one), live);
	}

	add(at) {
		const {rows, columns} = this.rows();
		if (at) this.changed([...rows, [...toPlace(at), ...(rows.at(-1) ?? columns.map(column => column.default)).slice(2)]], false);
	}

	turn(east, north) {
		this.lon = (this.lon + east + 540) % 360 - 180;
		this.lat = Math.max(-90, Math.min(90, this.lat + north));
		this.viewer.place();
	}

	key(event) {
		const by = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key], far = event.shiftKey ? 20 : 5;
		if (by) this.turn(by[0] * far, by[1] * far);
		else if (event.key === "Enter") this.add(toVector(this.lon, this.lat));
		else return false;
		return true;
	}
}
