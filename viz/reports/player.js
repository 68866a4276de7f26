// Plays runs of one drive: the truth in grey, an estimate in its colour with what it states of its error, and its NEES.
(() => {
const SECONDS = 16, CLOSER = 6; // of a whole film; when the map is enlarged
const SIDE = 1.96, ELLIPSE = 2.448; // standard deviations: 95 % across a wall, and of a position
const LEGEND = [
  ["true walls", '<path d="M0 7H26" stroke="var(--solid)" stroke-width="5"/>'],
  ["estimated walls, with the 95 % that they state", '<path d="M0 7H26" stroke="var(--own)" stroke-width="9" opacity=".3"/><path d="M0 7H26" stroke="var(--own)" stroke-width="2"/>'],
  ["not confirmed yet", '<path d="M0 7H26" stroke="var(--own)" stroke-width="1.5" stroke-dasharray="4 3"/>'],
  ["true position and path", '<path d="M0 7H26" stroke="var(--soft)" stroke-dasharray="3 3"/><circle cx="13" cy="7" r="3.5" fill="var(--ink)"/>'],
  ["estimate, with its 95 % ellipse", '<ellipse cx="13" cy="7" rx="12" ry="6" fill="var(--own)" fill-opacity=".25" stroke="var(--own)"/><circle cx="13" cy="7" r="2" fill="var(--own)"/>'],
  ["95 % band of a consistent estimator", '<rect y="1" width="26" height="12" fill="var(--band)"/>'],
];
const made = (kind, place, words = "", name = "") => {
  const element = document.createElement(kind);
  element.textContent = words;
  element.className = name;
  place.append(element);
  return element;
};
const digits = value => value == null ? "–" : value >= 100 ? String(Math.round(value)) : value.toPrecision(3);
const percent = value => value == null ? "–" : `${digits(100 * value)} %`;
const nice = value => { // the largest of 1, 2, 5 times a power of ten that is no more
  const power = 10 ** Math.floor(Math.log10(value)), share = value / power;
  return power * (share >= 5 ? 5 : share >= 2 ? 2 : 1);
};
const length = mm => mm >= 1000 ? `${mm / 1000} m` : mm >= 10 ? `${mm / 10} cm` : `${mm} mm`;
const dot = (context, x, y, radius, colour) => {
  context.fillStyle = colour;
  context.beginPath(); context.arc(x, y, radius, 0, 7); context.fill();
};
const error = (pose, truth) => pose && Math.hypot(pose[0] - truth[0], pose[1] - truth[1]);

function wallsOf(run) { // by step: all walls; a change replaces a wall, or removes it
  const now = new Map();
  return run.walls.map(changes => {
    for (const [id, ...wall] of changes) wall.length ? now.set(id, wall) : now.delete(id);
    return [...now.values()];
  });
}

function play(root) {
  const { films, colours } = JSON.parse(root.querySelector("script").textContent);
  let film, run, walls, at = 0, playing = 0, reach, middle; // middle: where the map is enlarged
  const stage = made("div", root, "", "stage"), choices = made("div", stage, "", "choices");
  const label = made("label", choices, films.length > 1 ? "World " : films[0].title), world = films.length > 1 && made("select", label);
  const runs = made("fieldset", choices), map = made("canvas", stage, "", "map"), side = made("div", stage, "", "side");
  const lens = made("canvas", side, "", "lens"), told = made("div", side, "", "told"), nees = made("canvas", stage, "", "nees");
  const keys = made("div", stage, "", "keys"), button = made("button", keys, "▶ Play"), scrubber = made("input", keys), place = made("output", keys);
  const legend = made("ul", stage, "", "legend"), cells = {};
  for (const [words, drawn] of LEGEND) made("li", legend, words).insertAdjacentHTML("afterbegin", `<svg viewBox="0 0 26 14" fill="none">${drawn}</svg>`);
  made("li", legend, "Space plays, ← and → step; click into the map, or press z, to come closer.");
  for (const words of ["NEES now", "pose ANEES", "steps in the band", "position error", "contour mapped"]) {
    const row = made("div", told);
    made("span", row, words);
    cells[words] = [made("b", row), made("small", row)];
  }
  [button.type, scrubber.type] = ["button", "range"];
  for (const [element, words] of [[runs, "estimator"], [scrubber, "step"], [map, "map"], [lens, "position, enlarged"], [nees, "NEES along the path"]]) {
    element.setAttribute("aria-label", words);
    if (element.getContext) element.setAttribute("role", "img");
  }
  const group = `estimator-${[...document.querySelectorAll(".player")].indexOf(root)}`;
  films.forEach((each, index) => { if (world) made("option", world, each.title).value = index; });

  const style = name => getComputedStyle(root).getPropertyValue(name).trim();
  const isDark = () => parseInt(style("--page").slice(1, 3), 16) < 128;
  const colourOf = name => { // on a dark page dark colours are mixed with white
    const colour = colours[name] || "#2D002D";
    const mixed = [1, 3, 5].map(k => parseInt(colour.slice(k, k + 2), 16)).map(c => isDark() ? Math.round(c + .4 * (255 - c)) : c);
    return `rgb(${mixed.join(" ")})`;
  };

  function choose(index) {
    [film, middle] = [films[index], null];
    at = Math.min(at, last());
    scrubber.max = last();
    runs.replaceChildren();
    for (const [k, each] of film.runs.entries()) {
      const label = made("label", runs);
      Object.assign(made("input", label), { type: "radio", name: group, onchange: () => estimate(k) });
      made("i", label);
      label.append(each.backend);
    }
    // So wide is the lens, from its middle to a side, that every error and ellipse of the film fits.
    reach = 1.1 * Math.max(5, ...film.runs.flatMap(each => each.poses.map((pose, k) => pose
      ? error(pose, film.true[k]) + ELLIPSE * Math.sqrt(Math.max(each.covs[k][0], each.covs[k][2])) : 0)));
    estimate(Math.max(0, film.runs.findIndex(each => run && each.backend === run.backend)));
  }

  function estimate(k) {
    run = film.runs[k];
    walls = wallsOf(run);
    runs.querySelectorAll("input")[k].checked = true;
    draw();
  }

  function canvasOf(canvas, height) { // a context in CSS pixels, cleared
    const ratio = devicePixelRatio || 1, width = canvas.clientWidth;
    if (height) canvas.style.height = `${height}px`;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round((height || canvas.clientHeight) * ratio);
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.font = `12px ${style("font-family")}`;
    context.lineJoin = context.lineCap = "round";
    return [context, width, canvas.height / ratio];
  }

  function bar(context, scale, height, longest) { // a scale bar at the lower left
    const mm = nice(longest / scale), end = 10 + mm * scale;
    context.fillStyle = style("--page");
    context.globalAlpha = .8;
    context.fillRect(4, height - 27, Math.max(end, 10 + context.measureText(length(mm)).width) + 2, 24);
    context.globalAlpha = 1;
    context.strokeStyle = context.fillStyle = style("--ink");
    context.lineWidth = 1.5;
    context.beginPath();
    for (const [x, up] of [[10, 12], [10, 8], [end, 8], [end, 12]]) context.lineTo(x, height - up);
    context.stroke();
    context.textAlign = "left";
    context.fillText(length(mm), 10, height - 14);
  }

  function scene(context, scale, toX, toY, near = false) {
    const own = colourOf(run.backend), truth = film.true[at], pose = run.poses[at];
    const line = points => { context.beginPath(); points.forEach(p => p && context.lineTo(toX(p[0]), toY(p[1]))); };
    [context.fillStyle, context.strokeStyle, context.lineWidth] = [style("--floor"), style("--solid"), 5];
    context.beginPath();
    for (const ring of film.floor) {
      for (let k = 0; k < ring.length; k += 2) context[k ? "lineTo" : "moveTo"](toX(ring[k]), toY(ring[k + 1]));
      context.closePath();
    }
    context.fill("evenodd");
    context.stroke();
    for (const [x, y, u, v, s, t, tentative] of walls[at]) {
      const far = Math.hypot(u - x, v - y) || 1, nx = SIDE * (y - v) / far, ny = SIDE * (u - x) / far;
      context.fillStyle = context.strokeStyle = own;
      context.globalAlpha = tentative ? .12 : .3;
      line([[x + s * nx, y + s * ny], [u + t * nx, v + t * ny], [u - t * nx, v - t * ny], [x - s * nx, y - s * ny]]);
      context.fill();
      context.globalAlpha = 1;
      context.lineWidth = tentative ? 1 : 1.8;
      context.setLineDash(tentative ? [4, 3] : []);
      line([[x, y], [u, v]]);
      context.stroke();
    }
    context.setLineDash([]);
    [context.strokeStyle, context.lineWidth] = [own, 1.1];
    line(run.poses.slice(0, at + 1));
    context.stroke();
    context.setLineDash([3, 3]);
    context.strokeStyle = style("--soft");
    line(film.true.slice(0, at + 1));
    context.stroke();
    context.setLineDash([]);
    [context.strokeStyle, context.lineWidth] = [style("--ink"), 1.3];
    context.beginPath();
    context.arc(toX(truth[0]), toY(truth[1]), film.radius * scale, 0, 7);
    context.moveTo(toX(truth[0]), toY(truth[1]));
    context.lineTo(toX(truth[0] + film.radius * Math.cos(truth[2] / 1000)), toY(truth[1] + film.radius * Math.sin(truth[2] / 1000)));
    context.stroke();
    if (!pose) return;
    const [a, b, c] = run.covs[at], mean = (a + c) / 2, apart = Math.hypot((a - c) / 2, b);
    context.strokeStyle = context.fillStyle = own;
    context.beginPath();
    context.ellipse(toX(pose[0]), toY(pose[1]), ELLIPSE * scale * Math.sqrt(mean + apart), ELLIPSE * scale * Math.sqrt(Math.max(mean - apart, 0)),
      -Math.atan2(2 * b, a - c) / 2, 0, 7);
    context.globalAlpha = .25;
    context.fill();
    context.globalAlpha = 1;
    context.lineWidth = 1.8;
    context.stroke();
    dot(context, toX(truth[0]), toY(truth[1]), near ? 4 : 0, style("--ink"));
    dot(context, toX(pose[0]), toY(pose[1]), near ? 3 : 1.5, own);
  }

  function drawMap() {
    const low = [1e9, 1e9], high = [-1e9, -1e9];
    for (const ring of film.floor) ring.forEach((value, k) => { low[k % 2] = Math.min(low[k % 2], value); high[k % 2] = Math.max(high[k % 2], value); });
    const room = 14, wide = high[0] - low[0], tall = high[1] - low[1], width = map.clientWidth;
    const fit = Math.min((width - 2 * room) / wide, (Math.max(260, Math.min(.62 * innerHeight, 480)) - 2 * room) / tall);
    const [context, , height] = canvasOf(map, Math.round(tall * fit + 2 * room) + 26);
    const scale = (middle ? CLOSER : 1) * fit, [x, y] = middle || [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    scene(context, scale, v => width / 2 + (v - x) * scale, v => (height - 26) / 2 - (v - y) * scale);
    bar(context, scale, height, 90);
    map.onclick = event => {
      middle = middle ? null : [x + (event.offsetX - width / 2) / scale, y - (event.offsetY - (height - 26) / 2) / scale];
      draw();
    };
  }

  function drawLens() {
    const [context, width, height] = canvasOf(lens), scale = width / 2 / reach, [x, y] = film.true[at];
    scene(context, scale, v => width / 2 + (v - x) * scale, v => height / 2 - (v - y) * scale, true);
    bar(context, scale, height, width / 3);
    context.fillStyle = style("--soft");
    context.fillText("position, enlarged", 8, 16);
  }

  const frame = { left: 56, right: 6, top: 8, bottom: 32 };
  function drawNees() {
    const [context, width, height] = canvasOf(nees), right = width - frame.right, bottom = height - frame.bottom;
    const all = film.runs.flatMap(each => each.nees).filter(value => value > 0), decade = value => Math.log10(value);
    const lowest = Math.max(-1.5, decade(Math.min(film.band[0] / 2, ...all))), highest = decade(Math.max(2 * film.band[1], ...all)) + .1;
    const last = film.path_m.at(-1) || 1, toX = m => frame.left + (right - frame.left) * m / last;
    const toY = value => bottom - (bottom - frame.top) * (Math.max(lowest, decade(value)) - lowest) / (highest - lowest);
    const rule = (x, y, u, v) => { context.beginPath(); context.moveTo(x, y); context.lineTo(u, v); context.stroke(); };
    context.fillStyle = style("--band");
    context.fillRect(frame.left, toY(film.band[1]), right - frame.left, toY(film.band[0]) - toY(film.band[1]));
    [context.fillStyle, context.strokeStyle, context.lineWidth] = [style("--soft"), style("--solid"), .5];
    [context.textAlign, context.textBaseline] = ["right", "middle"];
    for (let power = Math.ceil(lowest); power <= highest; power++) {
      const y = toY(10 ** power);
      rule(frame.left, y, right, y);
      context.fillText(String(10 ** power), frame.left - 6, y);
    }
    [context.textAlign, context.textBaseline] = ["center", "alphabetic"];
    const tick = nice(last / (width > 500 ? 6 : 4));
    for (let m = 0; m <= last; m += tick) context.fillText(String(+m.toFixed(2)), toX(m), bottom + 14);
    context.fillText("path length (m)", (frame.left + right) / 2, height - 3);
    context.save();
    context.rotate(-Math.PI / 2);
    context.fillText("NEES of the pose", -(frame.top + bottom) / 2, 11);
    context.restore();
    const curve = (each, to) => {
      context.beginPath();
      each.nees.slice(0, to).forEach((value, k) => context[value && each.nees[k - 1] ? "lineTo" : "moveTo"](toX(film.path_m[k]), toY(value || 1)));
      context.stroke();
    };
    for (const each of [...film.runs.filter(other => other !== run), run]) {
      [context.strokeStyle, context.globalAlpha, context.lineWidth] = [colourOf(each.backend), .35, 1];
      curve(each);
    }
    [context.globalAlpha, context.lineWidth] = [1, 1.7];
    curve(run, at + 1);
    const x = toX(film.path_m[at]);
    [context.strokeStyle, context.lineWidth] = [style("--ink"), 1];
    rule(x, frame.top, x, bottom);
    if (run.nees[at]) dot(context, x, toY(run.nees[at]), 4, colourOf(run.backend));
  }

  function draw() {
    const value = run.nees[at], [low, high] = film.band, off = error(run.poses[at], film.true[at]);
    root.style.setProperty("--own", colourOf(run.backend));
    for (const [k, mark] of runs.querySelectorAll("label").entries()) mark.style.setProperty("--own", colourOf(film.runs[k].backend));
    for (const [name, shown, words] of [
      ["NEES now", digits(value), value == null ? "" : value > high ? "above the band" : value < low ? "below the band" : "in the band"],
      ["pose ANEES", digits(run.anees), "whole run; 1 is ideal"], ["steps in the band", percent(run.in_band), "whole run; 95 % is ideal"],
      ["position error", off == null ? "–" : `${(off / 10).toFixed(1)} cm`, ""], ["contour mapped", percent(run.coverage[at]), ""],
    ]) [shown, words].forEach((each, k) => { cells[name][k].textContent = each; });
    place.textContent = `step ${film.steps[at] + 1}, ${film.path_m[at].toFixed(1)} m`;
    scrubber.value = at;
    scrubber.setAttribute("aria-valuetext", place.textContent);
    drawMap(); drawLens(); drawNees();
  }

  const last = () => film.steps.length - 1;
  const show = k => { at = Math.max(0, Math.min(last(), k)); draw(); };
  function go(on) {
    cancelAnimationFrame(playing);
    playing = 0;
    button.textContent = on ? "❚❚ Pause" : "▶ Play";
    if (!on) return;
    if (at === last()) show(0);
    let position = at, before = performance.now();
    const next = now => {
      position += Math.max(now - before, 0) / 1000 * film.steps.length / SECONDS; // a frame may be older than the key
      before = now;
      if (Math.floor(position) !== at) show(Math.floor(position));
      if (at < last()) playing = requestAnimationFrame(next); else go(false);
    };
    playing = requestAnimationFrame(next);
  }
  const toggle = () => go(!playing), scrub = k => { go(false); show(k); };
  button.onclick = toggle;
  scrubber.oninput = () => scrub(Number(scrubber.value));
  if (world) world.onchange = () => { go(false); at = Infinity; choose(Number(world.value)); };
  nees.onpointerdown = nees.onpointermove = event => {
    if (!event.buttons) return;
    const m = (event.offsetX - frame.left) / (nees.clientWidth - frame.left - frame.right) * film.path_m.at(-1);
    scrub(film.path_m.filter(value => value < m).length);
  };
  root.onkeydown = event => {
    const to = { ArrowLeft: at - 1, ArrowRight: at + 1, PageDown: at - 10, PageUp: at + 10, Home: 0, End: last() }[event.key];
    if (event.target === world || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === " " && event.target !== button) toggle();
    else if (event.key === "z") { middle = middle ? null : film.true[at]; draw(); }
    else if (to !== undefined && event.target.type !== "radio") scrub(to);
    else return;
    event.preventDefault();
  };
  root.tabIndex = -1; // keys work after a click, too
  at = Infinity;
  choose(0);
  new ResizeObserver(draw).observe(root);
  new MutationObserver(draw).observe(document.body, { attributeFilter: ["data-theme"] });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}
for (const root of document.querySelectorAll(".player")) play(root);
})();
