// Controls, drawn as the server declares them.

export const element = (name, properties = {}, ...children) => {
	const made = Object.assign(document.createElement(name), properties);
	made.append(...children);
	return made;
};

const counts = (control, all, settings) =>
	Object.entries(control.when).every(([name, values]) => values.includes(settings[name]) && counts(all.find(c => c.name === name), all, settings));

export const inEffect = (controls, settings) => controls.filter(control => counts(control, controls, settings));

export const defaults = controls => Object.fromEntries(controls.map(control => [control.name, control.default]));

// Numbers of things that a small picture has no room for, as it is opened: as many as fit.
export function fitted(controls, settings, n_pixels, before) {
	const numbers = controls.filter(control => control.room && control.default !== "auto" && [control.default, before[control.name]].includes(settings[control.name]));
	return Object.fromEntries(numbers.map(({name, room, low, default: usual}) => [name, Math.min(usual, Math.max(low, Math.floor(n_pixels / room)))]));
}

// changed(name, value, live): live while a slider moves; refused(text): what is typed is not allowed
export class Controls {
	constructor(form, changed, openPalette, refused) {
		Object.assign(this, {form, changed, openPalette, refused});
		form.addEventListener("submit", event => event.preventDefault());
		form.addEventListener("input", ({target}) => { this.typing = target.matches("[type=number], [type=text]"); });
		form.addEventListener("change", () => { this.typing = false; }, true);
		form.addEventListener("focusout", () => { this.typing = false; if (this.later) this.draw(...this.later); });
	}

	// palettes: [{id, name}], pictures: [{id, name}]
	draw(controls, settings, files) {
		this.later = this.typing && controls === this.controls && [controls, settings, files];
		if (this.later) return; // what is typed stays until it is chosen or left
		this.typing = false;
		const shown = inEffect(controls, settings).filter(control => control.kind !== "swatches" && (!control.only || control.only === files.kind)), key = JSON.stringify([shown.map(control => control.name), files]);
		if (this.key !== key || this.controls !== controls) {
			const focused = this.form.contains(document.activeElement) ? document.activeElement.id : "";
			this.form.replaceChildren(...shown.map(control => this.made(control, files)));
			if (focused) document.getElementById(focused)?.focus();
		}
		this.key = key;
		this.controls = controls;
		for (const control of shown) this.set[control.name](settings[control.name]);
	}

	set = {};

	made(control, files) {
		const id = `c-${control.name}`, field = element("div", {className: control.kind === "number" ? "field" : "field wrap"});
		const row = element("div", {className: "control"}, element("label", {htmlFor: id, textContent: control.label}), field);
		if (control.about) {
			row.append(element("div", {className: "note", id: `${id}-note`, textContent: control.about}));
		}
		field.append(...this[control.kind](control, id, files));
		const main = field.querySelector(`#${id}`);
		if (control.about && main) main.setAttribute("aria-describedby", `${id}-note`);
		return row;
	}

	choice(control, id) {
		const select = element("select", {id}, ...Object.entries(control.choices).map(([value, label]) => new Option(label, value)));
		select.onchange = () => this.changed(control.name, select.value, false);
		this.set[control.name] = value => { select.value = value; };
		return [select];
	}

	switch(control, id) {
		const box = element("input", {id, type: "checkbox"});
		box.onchange = () => this.changed(control.name, box.checked, false);
		this.set[control.name] = value => { box.checked = value; };
		return [box];
	}

	number(control, id) {
		const {low, high, step, log} = control, [from, to] = control.slider ?? [low, high], places = step < 1 ? Math.ceil(-Math.log10(step)) : 0;
		const toSlider = value => log ? Math.round(1000 * Math.log(value / from) / Math.log(to / from)) : value;
		const rounded = value => Number((Math.round(value / step) * step).toFixed(places));
		const fromSlider = value => log ? rounded(from * (to / from) ** (value / 1000)) : rounded(Number(value));
		const slider = element("input", {id, type: "range", min: log ? 0 : from, max: log ? 1000 : to, step: log ? 1 : step});
		const typed = element("input", {type: "number", min: control.low, max: control.high, step: "any", ariaLabel: `${control.label}, typed`});
		const parts = [slider, typed];
		let now = control.default;
		slider.oninput = () => this.changed(control.name, fromSlider(slider.value), true);
		slider.onchange = () => this.changed(control.name, fromSlider(slider.value), false);
		if (log) { // a key moves to the next number, however near it is
			slider.onkeydown = event => {
				const by = {ArrowLeft: -step, ArrowDown: -step, ArrowRight: step, ArrowUp: step}[event.key];
				if (!by) return;
				event.preventDefault();
				const value = Number(typed.value) || control.default;
				this.changed(control.name, Math.min(high, Math.max(low, rounded(value + by))), true);
			};
			slider.onkeyup = event => { if (event.key.startsWith("Arrow")) this.changed(control.name, Number(typed.value), false); };
		}
		typed.onchange = () => {
			const value = Number(typed.value), fits = typed.value !== "" && value >= low && value <= high && (step !== 1 || Number.isInteger(value));
			if (fits) return this.changed(control.name, rounded(value), false);
			if (typed.value !== "" || typed.validity.badInput) this.refused(`${control.label}: ${typed.value || "this"} must be a ${step === 1 ? "whole " : ""}number ${high > 1e9 ? `>= ${low}` : `in ${low}..${high}`}.`);
			this.set[control.name](now); // what is shown holds
		};
		if (control.unit) parts.push(element("span", {textContent: control.unit}));
		let auto = null;
		if (control.auto) {
			auto = element("input", {type: "checkbox", ariaLabel: `${control.label}: auto`});
			auto.onchange = () => this.changed(control.name, auto.checked ? "auto" : fromSlider(slider.value), false);
			parts.push(element("label", {}, auto, "auto"));
		}
		this.set[control.name] = value => {
			now = value;
			const isAuto = value === "auto";
			if (auto) auto.checked = isAuto;
			slider.classList.toggle("auto", isAuto); // moving it ends auto
			typed.placeholder = isAuto ? "auto" : "";
			if (isAuto) { typed.value = ""; slider.ariaValueText = "auto"; return; }
			const place = toSlider(Math.max(value, log ? from / 1e3 : value));
			if (!log || fromSlider(slider.value) !== value) slider.value = place;
			slider.ariaValueText = `${value}${control.unit ? " " + control.unit : ""}`;
			typed.value = value;
		};
		return parts;
	}

	colors(control, id) {
		const list = element("span", {className: "field wrap"});
		const chooser = element("input", {id, type: "color", value: "#ffffff"});
		const add = element("button", {type: "button", textContent: "Lock this color"});
		let now = [];
		add.onclick = () => this.changed(control.name, [...new Set([...now, chooser.value])], false);
		this.set[control.name] = value => {
			now = value;
			list.replaceChildren(...value.map(color => {
				const chip = element("button", {type: "button", className: "chip", title: "Unlock", ariaLabel: `Unlock ${color}`}, element("i"), `${color} ×`);
				chip.firstChild.style.background = color;
				chip.onclick = () => this.changed(control.name, now.filter(one => one !== color), false);
				return chip;
			}));
		};
		return [chooser, add, list];
	}

	table(control, id) {
		const list = element("div", {className: "rows", role: "group", ariaLabel: control.label});
		const add = element("button", {type: "button", id, textContent: control.adds});
		let now = [];
		const put = rows => this.changed(control.name, rows, false);
		add.onclick = () => put([...now, control.columns.map(column => column.default)]);
		const cell = (column, value, row, at) => {
			const numeric = column.kind === "number", name = `${column.label} of row ${row + 1}`;
			const input = element("input", {type: numeric ? "number" : "text", value, step: "any", min: column.low, max: column.high, ariaLabel: name, title: column.label});
			input.onchange = () => {
				const typed = numeric ? Math.min(column.high, Math.max(column.low, Number(input.value))) : input.value.trim();
				put(now.map((old, index) => index === row ? old.map((one, place) => place === at ? (typed === "" || Number.isNaN(typed) ? one : typed) : one) : old));
			};
			return input;
		};
		this.set[control.name] = value => {
			if (JSON.stringify(value) === JSON.stringify(now) && list.children.length) return;
			now = value;
			const head = control.columns.map(column => element("span", {}, column.unit ? `${column.label}, ${column.unit}` : column.label));
			list.style.gridTemplateColumns = `repeat(${head.length}, minmax(0, 1fr)) 30px`;
			list.replaceChildren(...(value.length ? [...head, element("span")] : []), ...value.flatMap((cells, row) => {
				const remove = element("button", {type: "button", textContent: "×", title: "Remove", ariaLabel: `Remove row ${row + 1}`});
				remove.onclick = () => put(now.filter((_, index) => index !== row));
				return [...cells.map((one, at) => cell(control.columns[at], one, row, at)), remove];
			}));
			add.disabled = value.length >= control.most;
		};
		return [list, add];
	}

	edits(control, id) {
		const buttons = Object.entries(control.modes).map(([mode, label], index) => {
			const button = element("button", {type: "button", textContent: label, ...(index ? {} : {id})});
			button.onclick = () => this.edit(control, mode);
			return [mode, button];
		});
		const clear = element("button", {type: "button", textContent: "Clear"}), told = element("span");
		const brush = element("input", {type: "range", min: 0, max: 100, ariaLabel: "Size of the brush"});
		const row = element("span", {className: "field brush"}, element("span", {}, "Brush"), brush);
		clear.onclick = () => this.changed(control.name, [], false);
		brush.oninput = () => { this.editor.radius = Math.round(2 ** (brush.value / 12)); this.editor.viewer.drawTool(); };
		this.set[control.name] = value => {
			for (const [mode, button] of buttons) button.ariaPressed = this.editor.is(control, mode);
			row.hidden = !this.editor.brushes || !this.editor.is(control);
			brush.value = Math.log2(this.editor.radius) * 12;
			clear.hidden = told.hidden = !value.length;
			told.textContent = `${value.length} change${value.length > 1 ? "s" : ""}`;
		};
		return [...buttons.map(([, button]) => button), row, told, clear];
	}

	files(control, id, files) {
		if (control.of === "palettes") {
			const select = element("select", {id}, new Option(files.palettes.length ? "choose…" : "none open", ""), ...files.palettes.map(one => new Option(one.name, one.id)));
			const file = element("input", {type: "file", ariaLabel: "Open a palette file"});
			file.onchange = () => { if (file.files[0]) this.openPalette(file.files[0]); file.value = ""; };
			select.onchange = () => this.changed(control.name, select.value ? [select.value] : [], false);
			this.set[control.name] = value => { select.value = value[0] ?? ""; };
			return [select, element("label", {className: "button"}, "Open a palette…", file)];
		}
		const boxes = files.pictures.map((one, index) => {
			const box = element("input", {type: "checkbox", value: one.id, ...(index ? {} : {id})});
			box.onchange = () => this.changed(control.name, boxes.filter(b => b.checked).map(b => b.value), false);
			return box;
		});
		this.set[control.name] = value => { for (const box of boxes) box.checked = value.includes(box.value); };
		return boxes.map((box, index) => element("label", {}, box, files.pictures[index].name));
	}
}
