// The colors of a result: swatches to locate, copy and lock, or a table of segments.

import {element} from "/controls.js";

const $ = id => document.getElementById(id);
const MOST = 256, ROWS = 200;
export const hex = c => "#" + [c & 255, c >>> 8 & 255, c >>> 16 & 255].map(v => v.toString(16).padStart(2, "0")).join("");
const percent = share => share >= .0995 ? `${Math.round(share * 100)} %` : `${(share * 100).toFixed(share ? 2 : 0)} %`;

export class Shades {
	// located(index), locked(color), edited(colors, live, spot) where the colors can be edited
	constructor(located, locked, edited) {
		Object.assign(this, {located, locked, edited, held: null, editable: false});
		this.spot = -1;
		this.at = 0;
		const box = $("swatches");
		box.addEventListener("click", event => { const b = event.target.closest("button"); if (b && !this.moved) this.choose(Number(b.dataset.index)); });
		this.sortable(box);
		box.addEventListener("keydown", event => this.key(event));
		box.addEventListener("focusin", event => { this.at = [...box.children].indexOf(event.target); this.tell(Number(event.target.dataset.index)); });
		$("copyone").onclick = () => this.copy(this.hexes[this.spot]);
		$("lockone").onclick = () => this.locked(this.hexes[this.spot]);
		$("editone").oninput = () => this.edit($("editone").value, true);
		$("editone").onchange = () => this.edit($("editone").value, false);
		$("removeone").onclick = () => this.put(this.hexes.filter((_, index) => index !== this.spot), -1);
		$("addone").onclick = () => this.put([...this.hexes, this.hexes[this.spot] ?? "#ffffff"], this.hexes.length);
		$("copyall").onclick = () => this.copy(this.order.map(index => this.hexes[index]).join("\n"));
	}

	put(colors, spot, live = false) { this.edited(colors, live, spot); }
	edit(color, live) { this.put(this.hexes.map((old, index) => index === this.spot ? color : old), this.spot, live); }

	// Swatches are sorted by dragging them.
	sortable(box) {
		box.addEventListener("pointerdown", event => {
			const swatch = event.target.closest("button");
			this.moved = false;
			this.held = this.editable && swatch ? {swatch, x: event.clientX, y: event.clientY} : null;
		});
		box.addEventListener("pointermove", event => {
			const {held} = this;
			if (!held || (!this.moved && Math.hypot(event.clientX - held.x, event.clientY - held.y) < 5)) return;
			if (!this.moved) box.setPointerCapture(event.pointerId);
			this.moved = true;
			held.swatch.classList.add("held");
			const over = document.elementFromPoint(event.clientX, event.clientY)?.closest("#swatches button");
			if (!over || over === held.swatch) return;
			const list = [...box.children];
			if (list.indexOf(held.swatch) < list.indexOf(over)) over.after(held.swatch); else over.before(held.swatch);
		});
		const end = () => {
			const {held} = this;
			this.held = null;
			if (!held || !this.moved) return;
			held.swatch.classList.remove("held");
			const list = [...box.children];
			this.put(list.map(one => this.hexes[one.dataset.index]), list.indexOf(held.swatch));
		};
		box.addEventListener("pointerup", end);
		box.addEventListener("pointercancel", end);
	}

	draw(reply, kept, editable) {
		if (this.held && this.moved) return; // a swatch is on its way
		const {counts, labels} = reply.facts, total = counts.reduce((a, b) => a + b, 0) || 1;
		this.hexes = [...reply.palette].map(hex);
		this.shares = counts.map(count => count / total);
		this.counts = counts;
		this.labels = labels;
		this.editable = editable && counts.length <= MOST;
		$("edit").hidden = !this.editable;
		$("swatches").classList.toggle("sortable", this.editable);
		this.kept = kept;
		this.order = counts.map((_, index) => index).filter(index => !labels || (index && counts[index]));
		if (labels) this.order.sort((a, b) => counts[b] - counts[a]);
		if (this.spot >= reply.palette.length) this.spot = -1;
		const box = $("swatches"), shown = this.order.slice(0, MOST);
		while (box.children.length > shown.length) box.lastChild.remove();
		while (box.children.length < shown.length) box.append(element("button", {type: "button"}));
		this.at = Math.min(this.at, Math.max(shown.length - 1, 0));
		shown.forEach((index, place) => {
			const b = box.children[place];
			b.dataset.index = index;
			b.style.backgroundColor = this.hexes[index];
			b.title = b.ariaLabel = this.name(index);
			b.ariaPressed = this.spot === index;
			b.tabIndex = place === this.at ? 0 : -1;
			b.classList.toggle("kept", kept.includes(this.hexes[index]));
		});
		$("shadestitle").textContent = labels ? `Segments: ${this.order.length}` : `Palette: ${this.order.length}${this.order.length > MOST ? `, ${MOST} shown` : ""}`;
		$("copyall").hidden = $("copyone").hidden = $("lockone").hidden = $("pick").hidden = Boolean(labels);
		$("look").hidden = $("rows").hidden = !labels;
		if (labels) this.table();
		this.tell(this.spot);
	}

	name(index) {
		const locked = this.kept.includes(this.hexes[index]) ? ", locked" : "";
		return `${this.labels ? `Segment ${index}, ` : ""}${this.hexes[index]}, ${percent(this.shares[index])} of the pixels${locked}`;
	}

	tell(index) {
		const some = index >= 0 && index < this.hexes.length;
		$("shadename").textContent = some ? this.name(index) : `Choose a ${this.labels ? "segment to see where it is" : this.editable ? "color to edit it" : "color to see where it is"}.`;
		const chosen = this.spot >= 0 && this.spot < this.hexes.length;
		$("copyone").disabled = $("lockone").disabled = !chosen;
		for (const id of ["editone", "whereone", "removeone"]) $(id).hidden = !chosen;
		if (chosen && this.editable && document.activeElement !== $("editone")) $("editone").value = this.hexes[this.spot];
		$("copyone").textContent = chosen ? `Copy ${this.hexes[this.spot]}` : "Copy";
		$("lockone").textContent = chosen && this.kept.includes(this.hexes[this.spot]) ? "Unlock" : "Lock";
	}

	table() {
		const cells = (name, texts) => texts.map(text => element(name, {}, text));
		const rows = this.order.slice(0, ROWS).map(index => {
			const chip = element("button", {type: "button", className: "chip", ariaLabel: `Locate segment ${index}`, ariaPressed: this.spot === index}, element("i"), String(index));
			chip.firstChild.style.background = this.hexes[index];
			chip.onclick = () => this.choose(index);
			return element("tr", {}, ...cells("td", [chip, this.hexes[index], this.counts[index].toLocaleString("en"), percent(this.shares[index])]));
		});
		$("rows").replaceChildren(element("table", {}, element("tr", {}, ...cells("th", ["Segment", "Mean color", "Pixels", "Share"])), ...rows));
		if (this.order.length > ROWS) $("rows").append(`The ${ROWS} largest of ${this.order.length}; the table as CSV has all.`);
	}

	choose(index) {
		this.spot = this.spot === index ? -1 : index;
		this.located(this.spot);
	}

	key(event) {
		const box = $("swatches"), across = getComputedStyle(box).gridTemplateColumns.split(" ").length;
		const by = {ArrowLeft: -1, ArrowRight: 1, ArrowUp: -across, ArrowDown: across, Home: -MOST, End: MOST}[event.key];
		const index = Number(event.target.dataset.index);
		if (this.editable && by && event.altKey) {
			const colors = [...this.hexes], [moved] = colors.splice(index, 1), to = Math.min(Math.max(index + by, 0), colors.length);
			colors.splice(to, 0, moved);
			this.put(colors, to);
			box.children[to].focus();
		} else if (this.editable && event.key === "Delete") this.put(this.hexes.filter((_, one) => one !== index), -1);
		else if (by) {
			const next = Math.min(Math.max(this.at + by, 0), box.children.length - 1);
			box.children[this.at].tabIndex = -1;
			box.children[next].tabIndex = 0;
			box.children[next].focus();
		} else if (event.key === "l" && !this.labels) this.locked(this.hexes[index]);
		else if (event.key === "c" && !event.ctrlKey && !event.metaKey) this.copy(this.hexes[index]);
		else return;
		event.preventDefault();
		event.stopPropagation();
	}

	async copy(text) {
		await navigator.clipboard.writeText(text);
		$("shadename").textContent = "Copied.";
	}
}
