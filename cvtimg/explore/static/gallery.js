// All images that are open: small, to choose from, and the settings of the tab for each of them, as one ZIP file.

import {element} from "/controls.js";
import {get, send} from "/link.js";

const $ = id => document.getElementById(id);

export class Gallery {
	// asked(): what is to be made of an image, {tab, settings, output}, or null; chosen(picture); report(text); save(name, blob)
	constructor(asked, chosen, report, save) {
		Object.assign(this, {asked, chosen, report, save, shown: new Map(), running: false});
		$("applyall").onclick = () => this.running ? this.stop() : this.apply();
		$("all").addEventListener("close", () => this.stop());
	}

	open(pictures) {
		this.pictures = pictures;
		for (const picture of pictures) if (!this.shown.has(picture.id)) this.add(picture);
		$("allstate").textContent = `${pictures.length} images`;
		$("applyall").hidden = !this.asked();
		$("all").showModal();
	}

	add(picture) {
		const image = element("img", {alt: ""}), state = element("small");
		const button = element("button", {type: "button", title: picture.path}, image, element("span", {}, picture.name), state);
		button.onclick = () => { $("all").close(); this.chosen(picture); };
		this.shown.set(picture.id, {button, state});
		$("thumbnails").append(button);
		this.reading = (this.reading ?? Promise.resolve()).then(async () => { // one after the other
			try { image.src = URL.createObjectURL(await (await get(`/thumbnail/${picture.id}`)).blob()); } catch { state.textContent = "cannot be shown"; }
		});
	}

	stop() { this.running = false; }

	async apply() {
		const asked = this.asked(), {pictures} = this;
		let done = 0, made = 0;
		this.running = true;
		$("applyall").textContent = "Stop";
		for (const {state} of this.shown.values()) state.textContent = "";
		for (const picture of pictures) {
			if (!this.running) break;
			const {state} = this.shown.get(picture.id);
			$("allstate").textContent = `${done} of ${pictures.length} done`;
			$("allshare").value = done / pictures.length;
			$("allshare").hidden = false;
			state.textContent = "working…";
			try {
				const {bytes} = await send("/all", JSON.stringify({...asked, tints: asked.tints?.length === picture.channels.length ? asked.tints : null, picture: picture.id, first: !done}));
				state.textContent = `${(bytes / 1e3).toFixed(bytes < 1e4 ? 1 : 0)} kB`;
				made++;
			} catch (error) { state.textContent = error.message; }
			done++;
		}
		this.running = false;
		$("allshare").hidden = true;
		$("applyall").textContent = "Apply to all";
		$("allstate").textContent = `${made} of ${pictures.length} made`;
		if (made) this.save("results.zip", await (await get("/all.zip")).blob());
	}
}
