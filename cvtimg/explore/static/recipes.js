// What can be had of a result: its files, and the command and the lines of Python that make them.

import {element} from "/controls.js";
import {get, weight} from "/link.js";

const $ = id => document.getElementById(id);

export class Recipes {
	// report(text): tells of a file that could not be had
	constructor(report) {
		Object.assign(this, {report, list: [], tab: "", result: ""});
		$("output").onchange = () => this.showChosen();
		$("download").onclick = event => { event.preventDefault(); this.download(); };
		$("copyimage").onclick = () => this.copyImage();
	}

	get chosen() { return this.list.find(one => one.key === $("output").value); }
	get image() { return this.list.find(one => one.file.endsWith(".png")); }

	show(list, tab) {
		const select = $("output"), chosen = this.tab === tab ? select.value : "";
		Object.assign(this, {list, tab});
		if ([...select.options].map(one => one.value).join() !== list.map(one => one.key).join()) {
			select.replaceChildren(...list.map(one => new Option(one.label, one.key)));
		}
		select.value = list.some(one => one.key === chosen) ? chosen : list[0].key;
		$("recipe").hidden = $("save").hidden = false;
		this.showChosen();
	}

	showChosen() {
		const {chosen} = this;
		for (const name of ["command", "folder"]) write($(name), chosen[name] ?? "");
		$("python").textContent = chosen.python;
		$("many").hidden = !chosen.folder;
		$("copylink").textContent = "Copy link";
		if (this.result) this.offer(this.result);
	}

	hide() { $("recipe").hidden = $("save").hidden = true; }

	offer(result) {
		this.result = result;
		$("copyimage").hidden = !this.image;
		$("copyimage").textContent = "Copy";
		$("copyimage").disabled = false;
		$("download").href = "#";
		$("download").ariaDisabled = "false";
	}

	// Tells the size of the first file, and lists those of all images beside each other where pictures are small: lossy
	// ones, too, as small as a quality allows.
	async weigh({width, height}, tell, lossy, least) {
		const {result, list} = this, turn = this.turn = {}, chips = [], end = file => file.split(".").pop().toUpperCase();
		const files = list.filter((one, n) => !n || one.key.startsWith("o."));
		const others = lossy.map(kind => ({key: `${least}.${kind}`, file: `${list[0].file.replace(/\.\w+$/, "")}-${least}.${kind}`, lossy: true}));
		$("lossy").hidden = !others.length || width * height >= 4e6;
		for (const one of width * height < 4e6 ? [...files, ...others] : files.slice(0, 1)) {
			const {bytes, quality} = await weight(`/file/${result}/${one.key}`).catch(() => ({bytes: 0}));
			if (this.result !== result || this.turn !== turn) return;
			if (one === list[0]) tell(bytes);
			if (!bytes) continue;
			const name = `${end(one.file)}${one.lossy && end(one.file) === "WEBP" ? " lossy" : ""}`;
			const chip = element("button", {type: "button", title: `Download ${name}${quality ? `; it looks ${quality} of 100` : ""}`}, `${name} ${size(bytes)}`, ...quality ? [element("small", {}, ` ${quality}`)] : []);
			chip.onclick = () => this.download(one);
			chips.push(chip);
			if (chips.length > 1) $("sizes").replaceChildren(...chips);
		}
	}

	withdraw() {
		this.result = $("sizes").textContent = "";
		$("copyimage").disabled = true;
		$("download").removeAttribute("href");
		$("download").ariaDisabled = "true";
	}

	file(recipe) { return get(`/file/${this.result}/${recipe.key}`); }

	async copyImage() {
		const pixels = this.file(this.image).then(async answer => new Blob([await answer.arrayBuffer()], {type: "image/png"}));
		try {
			await navigator.clipboard.write([new ClipboardItem({"image/png": pixels})]);
			$("copyimage").textContent = "Copied";
		} catch (error) { this.report(error.message); }
	}

	async download(chosen = this.chosen) {
		if (!this.result) return;
		try { save(chosen.file, await (await this.file(chosen)).blob()); } catch (error) { this.report(`${chosen.file}: ${error.message}`); }
	}
}

// Writes text whose words are not broken at their hyphens.
function write(place, text) {
	const parts = text.split(/(\s+)/).map(part => part.trim() ? element("span", {className: "word", textContent: part}) : part);
	place.replaceChildren(...parts);
}

export const size = bytes => bytes < 1e6 ? `${(bytes / 1e3).toFixed(bytes < 1e4 ? 1 : 0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;

export function save(download, blob) {
	const href = URL.createObjectURL(blob);
	element("a", {href, download}).click();
	setTimeout(() => URL.revokeObjectURL(href), 60_000);
}
