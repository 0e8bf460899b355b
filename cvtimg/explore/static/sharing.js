// Settings in a link, which an open page takes.

import {defaults} from "/controls.js";

export const linkTo = (tab, settings) => `${location.origin}/#settings=${encodeURIComponent(JSON.stringify({tab: tab.name, settings: own(tab, settings)}))}`;

function own({controls}, settings) { // what is chosen, but for open images
	const chosen = controls.filter(control => !isOfPictures(control) && JSON.stringify(settings[control.name]) !== JSON.stringify(control.default));
	return Object.fromEntries(chosen.map(({name}) => [name, settings[name]]));
}

const isOfPictures = ({kind, of}) => kind === "files" && of === "pictures";

// The text of a link. A page that may not enter yet keeps it until it may.
export function arrived() {
	const found = location.hash.match(/^#settings=(.+)/);
	if (found) { sessionStorage.shared = found[1]; history.replaceState(null, "", "/"); }
	return sessionStorage.shared;
}

// The tab of the link that arrived, and its settings; throws an error if they are not of these tabs.
export function taken(tabs) {
	const text = arrived();
	delete sessionStorage.shared;
	let given;
	try { given = JSON.parse(decodeURIComponent(text)); } catch { throw new Error("The settings of this link cannot be read."); }
	const tab = tabs.find(each => each.name === given?.tab), entries = Object.entries(given?.settings ?? {});
	if (!tab) throw new Error("The link's tab is not known here.");
	const wrong = entries.find(([name, value]) => !fits(tab.controls.find(control => control.name === name), value));
	if (wrong) throw new Error(`The link's setting ${wrong[0]} is not known here.`);
	return {name: tab.name, settings: {...defaults(tab.controls.filter(control => !isOfPictures(control))), ...given.settings}};
}

function fits(control, value) {
	if (!control) return false;
	if (control.auto && (value === "auto" || typeof value === "number")) return true;
	return typeof value === typeof control.default && Array.isArray(value) === Array.isArray(control.default);
}
