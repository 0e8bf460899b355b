// The page: what is open, what is chosen, and what is shown of it.

import {Controls, defaults, element, fitted, inEffect} from "/controls.js";
import {Curve} from "/curve.js";
import {Editor} from "/editor.js";
import {Gallery} from "/gallery.js";
import {Globe} from "/globe.js";
import {Link, admitted, get, send} from "/link.js";
import {Recipes, save, size} from "/recipes.js";
import {Shades, hex} from "/shades.js";
import {arrived, linkTo, taken} from "/sharing.js";
import {Steps} from "/steps.js";
import {Viewer} from "/viewer.js";

const $ = id => document.getElementById(id);
const PALETTE = /\.(gpl|ase|css|json|hex|act|pal|txt)$/i;
const REST = 250, AT_ONCE = 30; // milliseconds until the exact result is asked for

const state = {tabs: [], tab: "colors", settings: {}, fitted: {}, touched: new Set(), picture: null, frame: 0, pictures: [], palettes: [], spot: -1};
let last = null, before = null, kept = null, other = null, timer = 0, started = 0, share = 0, shared = 0, expected = 0, frame = 0;

const viewer = new Viewer({moved, picked});
const controls = new Controls($("controls"), change, file => openPalette(file), refuse);
const shades = new Shades(locate, toggleLock, (colors, live, spot) => {
	const old = shades.hexes[spot], {locked} = settings(), edited = colors.length === shades.hexes.length && colors[spot];
	const kept = colors.includes(old) || !edited ? locked : locked.map(one => one === old ? edited : one);
	change("colors", colors, live, {start: "hand", locked: kept});
	Object.assign(shades, {spot, hexes: colors});
});
const curve = new Curve($("curve"), (k, live) => change("k", k, live, {aim: "k"}));
const link = new Link(receive, lost, back);
const globe = new Globe(viewer, () => { const {columns, name} = circles(); return {columns, rows: settings()[name]}; }, (rows, live) => change(circles().name, rows, live));
const tab = () => state.tabs.find(one => one.name === state.tab);
const settings = () => state.settings[state.tab];
const sheet = () => tab()?.sheet && {width: tab().sheet[1], height: tab().sheet[0]}; // of a tab that needs no picture
const formats = new Controls($("lossy"), (name, value, live) => {
	state.wanted.value = value;
	formats.set[name](value);
	if (!live) weigh();
}, null, problem);
const steps = new Steps($("undo"), $("redo"), () => ({tab: state.tab, settings: state.settings}), choose);
const recipes = new Recipes(report);
const editor = new Editor(viewer, () => settings()[editor.control.name], text => change(editor.control.name, [...settings()[editor.control.name], text], false));
Object.assign(controls, {editor, edit});
const gallery = new Gallery(() => recipes.list.length && !sheet() ? {tab: state.tab, settings: settings(), channel: state.channel, tints: state.tints, output: recipes.chosen.key} : null, show, report, save);
const circles = () => inEffect(tab().controls, settings()).find(one => one.kind === "table");
const tools = {globe};
const subject = () => sheet() ?? state.picture;

// A server that is gone

function lost() {
	stopCounting();
	problem("The server has ended, or this machine was asleep. The page goes on once the server answers; where it was started again, open its new address.");
	$("problem").dataset.lost = "true";
}

function back() {
	delete $("problem").dataset.lost;
	problem("");
	if (state.picture) { link.ask("before", original(), {main: true}); want(); }
}

// What a reload finds again: settings and steps back in this tab of the browser, images and palettes on the server.

function keep() {
	if (!state.keep) return;
	const {tab, settings, palettes, pictures, picture} = state, {past, future} = steps;
	const now = {tab, settings, palettes, past, future, pictures: pictures.map(one => one.id), shown: picture?.id};
	try { sessionStorage.page = JSON.stringify(now); } catch { // many strokes: without steps back
		try { sessionStorage.page = JSON.stringify({...now, past: [], future: []}); } catch { delete sessionStorage.page; }
	}
}

function found() { // before anything can be chosen
	const then = JSON.parse(sessionStorage.page ?? "null");
	if (!then) return {};
	state.palettes = then.palettes;
	for (const [name, values] of Object.entries(then.settings)) Object.assign(state.settings[name] ?? {}, values);
	steps.take(then.past, then.future);
	return then;
}

// Choosing

function change(name, value, live, more = {}) {
	steps.before(name, value, live);
	state.touched.add(state.tab + name);
	if (name === "start" && value === "hand" && last?.facts.counts) more = {colors: shades.hexes}; // begins with what is seen
	state.settings[state.tab] = {...settings(), ...more, [name]: value};
	state.spot = shades.spot = -1;
	if (name === "space" && state.tab === "colors") measure();
	drawControls();
	want(performance.now(), live ? REST : AT_ONCE);
}

function choose({tab, settings}) { // what a step back finds
	state.settings = settings;
	if (tab !== state.tab) showTab(tab); else { drawControls(); want(); }
}

function edit(control, mode) { // what the pointer does on the picture: the same again ends it
	const now = editor.is(control, mode) ? "" : mode;
	if (!editor.mode) edit.before = {view: viewer.mode, fill: $("fill").value};
	editor.start(control, now);
	setTool();
	viewer.mode = now ? "result" : edit.before.view;
	$("fill").value = now ? "lines" : edit.before.fill;
	repaint();
	drawControls();
	if (now) $("stage").focus({preventScroll: true});
}

function setTool() {
	viewer.tool = tools[tab().tool] ?? (editor.mode ? editor : null);
	$("stage").classList.toggle("tool", Boolean(editor.mode));
	$("stage").ariaLabel = viewer.tool?.label ?? "Image: arrows move, plus and minus zoom";
}

function setFrame(number) {
	const {frames, noun} = state.picture;
	state.frame = number;
	$("film").hidden = frames < 2;
	$("filmname").textContent = noun;
	Object.assign($("frame"), {max: frames - 1, value: number, ariaValueText: `${number + 1} of ${frames}`});
	$("framename").textContent = `${number + 1} / ${frames}`;
}

function setChannel(number, tints) { // from 1; 0 for all in colors, -1 for all as they are
	const {channels, bands} = state.picture;
	Object.assign(state, {channel: number, tints: number ? null : tints});
	$("channels").hidden = !channels.length;
	$("channel").replaceChildren(new Option("all, in colors", 0), ...(bands ? [new Option("all, as they are", -1)] : []), ...channels.map((name, n) => new Option(name, n + 1)));
	$("channel").value = number;
	$("tints").replaceChildren(...(number ? [] : channels.map((name, at) => {
		const color = element("input", {type: "color", value: tints[at], title: name, ariaLabel: `Color of ${name}`});
		color.onchange = () => { setChannel(0, state.tints.with(at, color.value)); showFrame(state.frame); };
		return element("label", {}, color, name);
	})));
}

function locate(index) {
	shades.spot = index;
	state.spot = shades.editable && $("whereone").ariaPressed !== "true" ? -1 : index; // edits are seen in all colors
	repaint();
	drawShades();
}

function toggleLock(color) {
	if (!("locked" in settings())) return;
	const locked = settings().locked;
	const aim = settings().aim === "palette" ? {aim: "k"} : {};
	change("locked", locked.includes(color) ? locked.filter(one => one !== color) : [...locked, color], false, aim);
}

// Asking

const original = () => ({picture: state.picture?.id, frame: state.frame, channel: state.channel, tints: state.tints, view: viewer.visible()});
const asked = () => ({...original(), tab: state.tab, settings: settings()});

function want(t0 = performance.now(), rest = AT_ONCE) {
	clearTimeout(keep.timer); // writing all steps back takes longer than a drag may
	keep.timer = setTimeout(keep, REST);
	if (!subject() || link.gone) return;
	clearTimeout(timer);
	recipes.withdraw();
	refuse.stays = false;
	link.newest = 0; // results under way are of older settings
	want.t0 ??= t0;
	want.rest = rest;
	if (!frame) frame = requestAnimationFrame(() => { // at most one draft a frame
		frame = 0;
		link.ask("draft", asked(), {t0: want.t0, tab: state.tab});
		want.t0 = null;
		timer = setTimeout(wantExact, want.rest, t0);
	});
}

function wantExact(t0) {
	clearTimeout(timer);
	started = performance.now();
	share = 0;
	working();
	link.ask("exact", asked(), {t0: t0 ?? started, tab: state.tab});
}

function working() {
	clearInterval(working.timer);
	working.timer = setInterval(() => {
		if (!started) return clearInterval(working.timer);
		const seconds = (performance.now() - started) / 1000;
		if (seconds < .5) return;
		const whole = share > .2 ? seconds / share : expected; // what is done tells better than a draft
		const moves = share && share < 1 && performance.now() - shared < 4000; // else the bar shows that work goes on
		$("facts").textContent = `working… ${moves ? `${Math.floor(100 * share)} %, ` : ""}${seconds.toFixed(0)} s${whole > 10 ? ` of about ${Number(whole.toPrecision(1))} s` : ""}`;
		$("share").hidden = $("cancel").hidden = false;
		if (moves) $("share").value = share; else $("share").removeAttribute("value");
	}, 200);
}

function stopCounting() {
	started = share = 0;
	clearInterval(working.timer);
	$("share").hidden = $("cancel").hidden = true;
}

function cancel() {
	if (!started) return;
	link.cancel();
	stopCounting();
	facts();
	problem("Canceled. Change a setting to begin again.");
}

function moved() { // finer pixels of what is now in sight
	clearTimeout(moved.timer);
	moved.timer = setTimeout(() => {
		if (!state.picture || !before || sheet()) return;
		if (before.window[4] > 1) link.ask("before", original(), {main: true});
		if (last?.window?.[4] > 1 && recipes.result) wantExact();
	}, 150);
}

function receive(reply, about) {
	if (reply.error !== undefined) {
		if (!reply.error) return;
		problem(reply.error);
		if (about.lane === "before") return;
		stopCounting();
		recipes.hide(); // what was asked for has none
		$("facts").textContent = "";
		return;
	}
	if (about.lane === "before") return receivePicture(reply, about);
	if (about.tab !== state.tab) return;
	if (reply.share !== undefined) { share = reply.share; shared = performance.now(); return; }
	if (!refuse.stays) problem("");
	recipes.show(reply.recipes, state.tab);
	if (about.lane === "draft") expected = reply.seconds;
	if (reply.none) return;
	last = reply;
	$("stage").classList.toggle("old", about.lane === "draft");
	const drawn = repaint();
	drawShades();
	if (about.lane === "exact") {
		stopCounting();
		recipes.offer(reply.result);
	}
	facts();
	weigh();
	Promise.resolve(drawn).then(() => requestAnimationFrame(() => {
		const painted = new MessageChannel();
		painted.port1.onmessage = () => document.dispatchEvent(new CustomEvent("shown", {detail: {lane: about.lane, seq: reply.seq, ms: performance.now() - about.t0, k: reply.facts.k, settings: about.request.settings}}));
		painted.port2.postMessage(0);
	}));
}

function weigh() {
	const tell = bytes => $("facts").textContent.startsWith("reading") || facts(bytes); // the picture first
	if (recipes.result) recipes.weigh(subject(), tell, last.lossy, state.wanted.value);
}

async function resize() { // a picture of its own, which the lines that are shown make, too
	try { added(await send("/resize", JSON.stringify({...original(), width: Number($("width").value)}))); } catch (error) { report(error.message); }
}

function receivePicture(reply, about) {
	if (about.main && reply.picture === state.picture?.id) {
		before = reply;
		if (about.resolve) about.resolve();
		if ($("against").value === "original") showLeft();
		if (last && !viewer.right.under.hidden) repaint();
	} else if (!about.main) { other = reply; if ($("against").value === reply.picture) showLeft(); }
}

// Showing

function look() {
	const fill = $("fill").value;
	return last?.facts.labels ? {spot: state.spot, fill: fill !== "lines" || state.spot >= 0, lines: fill !== "fill"} : {spot: state.spot};
}

function repaint() {
	if (!last) return;
	$("stage").classList.remove("bare");
	const drawn = last.kind === "globe" ? globe.show(last) : viewer.right.show(last, subject(), look(), before);
	$("rightname").textContent = tab().title + (kept && $("against").value === "A" ? " (B)" : "");
	return drawn;
}

function showLeft() {
	const against = $("against").value, whole = state.picture;
	if (against === "A" && kept) { viewer.left.show(kept.last, whole, kept.look, before); $("leftname").textContent = `A: ${kept.name}`; }
	else if (against !== "original" && other?.picture === against) { viewer.left.show(stretched(other, whole), whole); $("leftname").textContent = state.pictures.find(one => one.id === against)?.name; }
	else if (before) { viewer.left.show(before, whole); $("leftname").textContent = "Original"; }
}

// Another picture is shown in the size of this one.
function stretched(reply, size) {
	const step = size.width / reply.width;
	return {...reply, window: [0, 0, size.width, size.height, step]};
}

function drawControls() {
	const files = {palettes: state.palettes.map(({id, name}) => ({id, name})), kind: state.picture?.frames > 1 ? "animations" : "images", pictures: state.pictures.map(({id, name}) => ({id, name}))};
	controls.draw(tab().controls, settings(), files);
	if (state.tab === "colors") curve.mark(settings().aim === "k" || !last ? settings().k : last.facts.k);
}

const sameSize = () => state.pictures.filter(one => ["width", "height"].every(side => one[side] === state.picture?.[side]) && `${one.channels}` === `${state.picture.channels}`);

function drawShades() {
	const {locked = [], start} = settings(), has = Boolean(last?.facts.counts);
	$("shades").hidden = !has;
	$("again").hidden = start !== "hand" || !locked.length;
	if (has) shades.draw(last, locked, "colors" in settings());
	if (state.tab === "colors" && last) curve.mark(last.facts.k);
}

function facts(bytes) {
	if (!last) { $("facts").textContent = ""; return; }
	const {width, height, distinct} = subject(), f = last.facts, parts = sheet() ? [] : [`${width} × ${height}`];
	const draft = recipes.result ? "" : "≈ ";
	const number = (n, noun) => `${n.toLocaleString("en")} ${n === 1 ? noun.replace("vertices", "vertex").replace(/s$/, "") : noun}`;
	if (f.noun) parts.push(number(f.k, f.noun));
	else if (f.labels) parts.push(draft + number(f.k, "segments"));
	else parts.push((state.picture.frames > 1 ? "" : `${distinct.toLocaleString("en")} → `) + number(f.k, "colors"), f.psnr === null ? "exact" : `${draft}${f.psnr.toFixed(2)} dB`);
	$("note").textContent = f.about ?? "";
	const saved = 1 - bytes / state.picture?.bytes;
	if (bytes && (f.noun || f.labels || !recipes.list[0].key.startsWith("o."))) parts.push(size(bytes)); // not of this image
	else if (bytes) parts.push(`${size(state.picture.bytes)} → ${size(bytes)}${saved >= .005 ? ` (${Math.round(100 * saved)} % saved)` : ""}`);
	$("facts").textContent = parts.join(" · ");
}

function problem(text) { // of the settings; it goes with the next result
	if ($("problem").dataset.lost) return;
	$("problem").textContent = text;
	$("problem").hidden = !text;
}

function refuse(text) { // what is typed; it stays until something else is chosen
	problem(text);
	refuse.stays = true;
}

function report(text) { // of a file; it stays until it is read
	const close = element("button", {type: "button", ariaLabel: "Close the message"}, "×");
	const line = element("p", {className: "trouble"}, element("span", {}, text), close);
	close.onclick = () => line.remove();
	$("troubles").append(line);
}

function takeShared() {
	if (!arrived() || !state.tabs.length) return;
	try {
		const {name, settings} = taken(state.tabs);
		steps.remember();
		state.settings[name] = {...state.settings[name], ...settings};
		showTab(name);
	} catch (error) { report(error.message); }
}

function listPresets(presets) { // those of this tab
	state.presets = presets;
	const names = Object.keys(presets).filter(name => presets[name].tab === state.tab);
	$("preset").replaceChildren(new Option("Presets…", ""), ...names.map(name => new Option(name)));
	$("preset").disabled = !names.length;
	$("presetname").hidden = $("savepreset").hidden = $("droppreset").hidden = state.stores === false;
	$("savepreset").disabled = $("droppreset").disabled = !$("presetname").value.trim();
}

function takePreset(name) {
	const {tab, settings: preset} = state.presets[name], {controls} = state.tabs.find(one => one.name === tab);
	steps.remember();
	const known = Object.fromEntries(Object.entries(preset).filter(([key]) => controls.some(one => one.name === key)));
	state.settings[tab] = {...defaults(controls), ...known};
	showTab(tab);
	$("presetname").value = name;
	listPresets(state.presets);
}

async function changePreset(settings) {
	try { listPresets(await send("/presets", JSON.stringify({name: $("presetname").value, tab: state.tab, settings}))); } catch (error) { report(error.message); }
}

async function takeCommand(text) { // sets what a command says, and the rest as usual
	try {
		const {tab, settings, left} = await send("/command", text), {controls} = state.tabs.find(one => one.name === tab);
		steps.remember();
		state.settings[tab] = {...defaults(controls), ...state.fitted[tab], ...settings};
		showTab(tab);
		if (left.length) report(`The page does not have ${left.join(", ")}.`);
	} catch (error) { report(error.message); }
}

function play(on) { // frame after frame, each as soon as it is there and the one before has had its time
	clearTimeout(play.timer);
	$("play").ariaPressed = on;
	$("play").textContent = on ? "Pause" : "Play";
	if (!on || !state.picture) return;
	const {frames, durations} = state.picture;
	play.timer = setTimeout(() => {
		if (!link.drafting && !started) showFrame((state.frame + 1) % frames);
		play(true);
	}, durations?.[state.frame] || 100);
}

function showFrame(number) {
	setFrame(number);
	link.ask("before", original(), {main: true});
	want();
}

function showTab(name) {
	if (editor.mode) edit(editor.control, editor.mode);
	state.tab = name;
	state.spot = shades.spot = -1;
	last = null;
	recipes.withdraw();
	for (const button of $("tabs").children) {
		const on = button.dataset.tab === name;
		button.ariaSelected = on;
		button.tabIndex = on ? 0 : -1;
	}
	$("panel").setAttribute("aria-labelledby", `tab-${name}`);
	$("about").textContent = tab().about;
	$("energy").hidden = name !== "colors" || !state.picture;
	$("shades").hidden = $("lossy").hidden = true;
	$("others").hidden = !state.picture || Boolean(sheet());
	recipes.hide();
	$("note").textContent = "";
	problem("");
	if (name === "restore" && !settings().versions.length) state.settings.restore = {...settings(), versions: sameSize().map(one => one.id)};
	if (viewer.picking && !("locked" in settings())) pick(false);
	drawControls();
	lay();
	$("rightname").textContent = "";
	if (!link.gone) stopCounting();
	want();
	listPresets(state.presets);
}

function lay() { // what the tab shows onto the stage: the picture, or a sheet of its own
	const size = subject(), {width, height} = viewer.size ?? {};
	$("stage").classList.toggle("empty", !size);
	$("open").parentElement.classList.toggle("main", !size); // what is done first
	$("stage").classList.toggle("alone", Boolean(sheet()));
	viewer.right.clear();
	$("stage").classList.add("bare");
	setTool();
	viewer.tool?.clear?.();
	if (!size) return;
	viewer.size = size;
	if (size.width !== width || size.height !== height) viewer.fit(); else viewer.place();
}

// Opening

async function open(files) {
	const images = [];
	for (const file of files) {
		if (PALETTE.test(file.name)) await openPalette(file); else images.push([file.name || "pasted.png", () => send(`/picture?name=${encodeURIComponent(file.name || "pasted.png")}`, file)]);
	}
	await read(images);
}

async function read(images, shown = null) { // [[name, what opens it]]: the first is shown, and is seen while the others are read
	for (const [number, [name, picture]] of images.entries()) {
		$("facts").textContent = `reading ${images.length > 1 ? `${number + 1} of ${images.length}, ` : ""}${name}…`;
		try { const showing = added(await picture(), !shown); shown ??= showing; } catch (error) { report(error.message); }
	}
	await shown;
	facts();
}

async function openPalette(file) {
	try {
		const palette = await send(`/palette?name=${encodeURIComponent(file.name)}`, file);
		state.palettes.push(palette);
		if (!["colors", "palette"].includes(state.tab)) showTab("colors");
		change("palette", [palette.id], false, state.tab === "palette" ? {start: "given"} : {aim: "palette"});
	} catch (error) { report(error.message); }
}

function added(picture, first = true) {
	state.pictures.push(picture);
	$("pictures").append(Object.assign(new Option(picture.name, picture.id), {title: picture.path}));
	$("pictures").hidden = false;
	$("showall").hidden = state.pictures.length < 2;
	$("against").append(new Option(picture.name, picture.id));
	const isVersion = state.tab === "restore" && state.picture && sameSize().includes(picture);
	if (isVersion) change("versions", [...settings().versions, picture.id], false); else if (first) return show(picture);
	return null;
}

async function show(picture) {
	show.wanted = picture;
	try { picture.distinct ??= (await (await get(`/distinct/${picture.id}`)).json()).distinct; } catch (error) { return report(error.message); }
	if (show.wanted !== picture) return;
	state.picture = picture;
	play(false);
	setFrame(0);
	setChannel(picture.channel, picture.tints);
	$("width").value = Math.round(picture.width / 2);
	$("pictures").value = picture.id;
	viewer.left.clear();
	if (sheet() && document.body.dataset.ready) state.tab = "colors";
	lay();
	last = before = other = kept = null;
	$("against").querySelector("[value=A]")?.remove();
	$("against").value = "original";
	$("swap").disabled = true;
	if (!state.settings.restore.versions.includes(picture.id)) state.settings.restore = {...state.settings.restore, versions: []}; // of another subject
	for (const {name, controls} of state.tabs) {
		state.fitted[name] = fitted(controls, state.settings[name], picture.width * picture.height, state.fitted[name] ?? {});
		state.settings[name] = {...state.settings[name], ...state.fitted[name]};
	}
	if (picture.distinct <= 2 && !state.touched.has("meshof")) state.settings.mesh = {...state.settings.mesh, of: "picture"};
	link.ask("before", original(), {main: true});
	showTab(state.tab);
	measure();
}

async function measure() {
	const {id} = state.picture, space = state.settings.colors.space;
	curve.set(null);
	const answer = await get(`/curve/${id}/${space}`).catch(() => null);
	if (!answer || state.picture.id !== id || state.settings.colors.space !== space) return;
	curve.set(await answer.json());
	drawControls();
	document.dispatchEvent(new CustomEvent("curve"));
}

// A and B

function keepA() {
	if (!last || !recipes.result || sheet()) return;
	kept = {last, look: look(), tab: state.tab, settings: JSON.stringify(state.settings), name: `${tab().title}, ${last.facts.k}`};
	if (!$("against").querySelector("[value=A]")) $("against").options[0].after(new Option("A", "A"));
	$("against").value = "A";
	$("swap").disabled = false;
	showLeft();
	repaint();
}

function swapA() {
	if (!kept || !last) return;
	const then = kept;
	steps.remember();
	kept = {last, look: look(), tab: state.tab, settings: JSON.stringify(state.settings), name: `${tab().title}, ${last.facts.k}`};
	state.settings = JSON.parse(then.settings);
	showTab(then.tab);
	showLeft();
}

// Colors picked in the picture

function pick(on) {
	viewer.picking = on;
	$("pick").ariaPressed = on;
	if (on) $("stage").focus();
}

async function picked({x, y}) {
	const has = () => before.window[4] === 1 && x >= before.window[0] && x < before.window[2] && y >= before.window[1] && y < before.window[3];
	if (!has()) await new Promise(resolve => link.ask("before", {...original(), view: [x, y, x + 1, y + 1]}, {main: true, resolve}));
	if (!has()) return;
	const [left, top] = before.window, at = 4 * ((y - top) * before.width + x - left), p = before.pixels;
	toggleLock(hex(p[at] | p[at + 1] << 8 | p[at + 2] << 16));
}

// Listening

$("open").onchange = event => { open([...event.target.files]); event.target.value = ""; };
$("pictures").onchange = event => show(state.pictures.find(one => one.id === event.target.value));
$("against").onchange = event => {
	const id = event.target.value;
	if (id !== "original" && id !== "A") link.ask("before", {picture: id, view: null});
	showLeft();
	repaint();
};
$("keep").onclick = keepA;
$("swap").onclick = swapA;
$("pick").onclick = () => pick(!viewer.picking);
$("again").onclick = () => change("start", "image", false, {k: Math.max(settings().colors.length, 1)});
$("whereone").onclick = () => { $("whereone").ariaPressed = $("whereone").ariaPressed !== "true"; locate(shades.spot); };
$("channel").onchange = () => { setChannel(Number($("channel").value), state.picture.tints); showFrame(state.frame); };
$("frame").oninput = () => { play(false); showFrame(Number($("frame").value)); };
$("play").onclick = () => play($("play").ariaPressed !== "true");
$("fill").onchange = repaint;
$("resize").onclick = resize;
$("cancel").onclick = cancel;
$("sample").onclick = () => read([["a sample", () => send("/sample")]]);
$("copylink").onclick = async () => { await navigator.clipboard.writeText(linkTo(tab(), settings())); $("copylink").textContent = "Copied"; };
addEventListener("hashchange", takeShared);
$("preset").onchange = () => $("preset").value && takePreset($("preset").value);
$("presetname").oninput = () => listPresets(state.presets);
$("savepreset").onclick = () => changePreset(settings());
$("droppreset").onclick = () => changePreset(null);
addEventListener("pagehide", keep);
$("forget").onclick = forget;
$("showall").onclick = () => gallery.open(state.pictures);
$("help").onclick = () => $("keys").showModal();
for (const button of document.querySelectorAll("[data-copy]")) {
	button.onclick = async () => { await navigator.clipboard.writeText($(button.dataset.copy).textContent); button.textContent = "Copied"; };
	button.onblur = () => { button.textContent = "Copy"; };
}
addEventListener("dragover", event => { event.preventDefault(); $("stage").classList.add("over"); });
addEventListener("dragleave", () => $("stage").classList.remove("over"));
addEventListener("drop", event => { event.preventDefault(); $("stage").classList.remove("over"); open([...event.dataTransfer.files]); });
addEventListener("paste", event => {
	const files = [...event.clipboardData.files], text = event.clipboardData.getData("text");
	if (files.length) open(files); else if (/^\s*(\$ )?cvtimg\s/.test(text)) takeCommand(text);
});

const KEYS = {
	"0": () => $("fit").click(), "1": () => $("one").click(), "+": () => $("in").click(), "=": () => $("in").click(), "-": () => $("out").click(),
	"[": () => viewer.divide(viewer.split - .02), "]": () => viewer.divide(viewer.split + .02), a: keepA, x: swapA, p: () => "locked" in settings() && pick(!viewer.picking),
	v: () => { const modes = ["divider", "beside", "result"]; viewer.mode = modes[(modes.indexOf(viewer.mode) + 1) % 3]; },
	"?": () => $("keys").showModal(), Escape: () => viewer.picking ? pick(false) : editor.mode ? edit(editor.control, editor.mode) : cancel(),
};
addEventListener("keydown", event => {
	const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
	if (event.ctrlKey || event.metaKey) {
		const act = {z: () => event.shiftKey ? steps.forward() : steps.back(), y: () => steps.forward(), o: () => $("open").click(), s: () => recipes.result && $("download").click()}[key];
		if (!act || (key === "z" && event.target.matches("input[type=number]"))) return;
		event.preventDefault();
		return act();
	}
	if (event.altKey || document.querySelector("dialog[open]") || event.target.matches("input:not([type=range], [type=checkbox]), select, textarea")) return;
	if (key === "b" && state.picture && !viewer.peek) { viewer.peek = true; viewer.place(); return; }
	if (KEYS[key] && subject() || key === "?") { event.preventDefault(); KEYS[key](); }
});
addEventListener("keyup", event => { if (event.key.toLowerCase() === "b" && viewer.peek) { viewer.peek = false; viewer.place(); } });

async function forget() {
	state.keep = false;
	delete sessionStorage.page;
	await send("/forget");
	location.reload();
}

async function start() {
	arrived();
	if (!await admitted) {
		$("limits").textContent = arrived() ? "Open the address that cvtimg explore printed in this tab: the settings of the link wait for it." : "Open the address that cvtimg explore printed.";
		$("sample").hidden = true;
		return;
	}
	let about;
	try { about = await (await get("/about")).json(); } catch (error) { return report(`${error.message}.`); }
	Object.assign(state, {tabs: about.tabs, palettes: about.palettes, presets: about.presets, stores: about.keep, keep: false});
	$("limits").textContent = `Up to ${about.megapixels} megapixels and ${about.megabytes} MB each. Nothing leaves this machine.`;
	$("kept").textContent = about.keep
		? "Images and results, on this machine, until the server ends; settings and steps back in this tab of the browser, until it is closed."
		: "Nothing: images go from this machine when the last page is closed or loaded again.";
	state.wanted = {...about.wanted, value: about.wanted.default};
	formats.draw([state.wanted], {[state.wanted.name]: state.wanted.value}, {});
	state.settings = Object.fromEntries(about.tabs.map(one => [one.name, defaults(one.controls)]));
	for (const one of about.tabs) {
		const button = element("button", {type: "button", id: `tab-${one.name}`, role: "tab"}, one.title);
		button.dataset.title = one.title; // which gives it the width of bold letters
		button.dataset.tab = one.name;
		button.setAttribute("aria-controls", "panel");
		button.onclick = () => { steps.remember(); showTab(one.name); };
		$("tabs").append(button);
	}
	$("tabs").addEventListener("keydown", event => {
		const by = {ArrowLeft: -1, ArrowRight: 1}[event.key], list = [...$("tabs").children];
		if (!by) return;
		event.preventDefault();
		event.stopPropagation();
		const next = list[(list.findIndex(one => one.dataset.tab === state.tab) + by + list.length) % list.length];
		next.click();
		next.focus();
	});
	const {pictures = [], shown, tab: then = "colors"} = about.keep ? found() : {};
	showTab(then);
	await read(about.given.map((name, number) => [name, () => send(`/given/${number}`)]), shown);
	for (const id of pictures) {
		if (!state.pictures.some(one => one.id === id)) await get(`/picture/${id}`).then(answer => answer.json()).then(one => { added(one, false); }, () => {});
	}
	if (shown && state.pictures.length) await show(state.pictures.find(one => one.id === shown) ?? state.pictures[0]);
	state.keep = about.keep;
	takeShared();
	facts();
	document.body.dataset.ready = "true";
}

start();
