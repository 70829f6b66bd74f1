"use strict";
/* Rows, filters, order and the open run all stand in the address, so that a view can be sent to someone. */
(() => {
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  const { columns, rows } = read("data");
  const runs = read("runs");
  const at = Object.fromEntries(columns.map(({ name }, place) => [name, place]));
  const titles = Object.fromEntries(columns.filter(({ title }) => title).map(({ name, title }) => [name, title]));
  const numeric = new Set(columns.filter((column) => column.numeric).map(({ name }) => name));
  const used = (name) => rows.some((row) => row[at[name]] !== null && row[at[name]] !== "" && row[at[name]] !== 0);
  const shown = Object.keys(titles).filter((name) => ["task", "method", "state", "mape"].includes(name) || used(name));
  const axes = ["mode", "chemistry", "rates", "method", "seed", "state"].filter(
    (name) => new Set(rows.map((row) => row[at[name]])).size > 1);
  const page = 300;
  let limit = page;

  const make = (tag, attributes = {}, ...children) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name === "on") for (const [event, action] of Object.entries(value)) element.addEventListener(event, action);
      else if (value !== null && value !== false) element.setAttribute(name, value === true ? "" : value);
    }
    element.append(...children);
    return element;
  };
  const digits = (value) => {
    if (value === null || value === undefined || value === "") return "–";
    if (typeof value !== "number") return String(value);
    if (Number.isInteger(value)) return String(value);
    const size = Math.abs(value);
    return size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(2) : String(Number(value.toPrecision(4)));
  };

  const state = () => new URLSearchParams(location.hash.slice(1));
  const change = (changes) => {
    const next = state();
    for (const [name, value] of Object.entries(changes)) value === "" ? next.delete(name) : next.set(name, value);
    history.replaceState(null, "", "#" + next.toString());
    draw();
  };

  const filters = document.getElementById("filters");
  filters.addEventListener("submit", (event) => event.preventDefault());
  for (const name of axes) {
    const values = [...new Set(rows.map((row) => row[at[name]]))].sort((a, b) => (a > b) - (a < b));
    const select = make("select", { name, on: { change: (event) => { limit = page; change({ [name]: event.target.value }); } } },
      make("option", { value: "" }, "all"), ...values.map((value) => make("option", { value }, String(value || "–"))));
    filters.append(make("label", {}, titles[name], select));
  }
  filters.append(make("label", {}, "Task contains",
    make("input", { name: "find", type: "search", on: { input: (event) => { limit = page; change({ find: event.target.value }); } } })));

  const select = (view) => rows.filter((row) =>
    axes.every((name) => !view.get(name) || String(row[at[name]]) === view.get(name))
    && (!view.get("find") || row[at.task].toLowerCase().includes(view.get("find").toLowerCase())));
  const order = (chosen, view) => {
    const wanted = view.get("sort") || "";
    const down = wanted.startsWith("-"), name = wanted.replace(/^-/, "");
    if (!(name in titles)) return chosen;
    const place = at[name], sign = down ? -1 : 1;
    return [...chosen].sort((a, b) => {
      const [x, y] = [a[place], b[place]];
      if (x === null || y === null) return (x === null) - (y === null);  // the unknown always stands last
      return sign * (typeof x === "string" ? x.localeCompare(y, "en", { numeric: true }) : x - y);
    });
  };

  const draw = () => {
    const view = state();
    for (const field of filters.elements) if (field.name && field.value !== (view.get(field.name) || "")) field.value = view.get(field.name) || "";
    const chosen = order(select(view), view);
    document.getElementById("selected").textContent = `${chosen.length} of ${rows.length} cells`;
    summary(chosen);
    const sorted = (view.get("sort") || "").replace(/^-/, ""), down = (view.get("sort") || "").startsWith("-");
    const head = make("tr", {}, ...shown.map((name) => make("th",
      { scope: "col", class: numeric.has(name) ? "n" : null, "aria-sort": name === sorted ? (down ? "descending" : "ascending") : null },
      make("button", { type: "button", on: { click: () => change({ sort: sorted === name && !down ? "-" + name : name }) } }, titles[name]))));
    const body = chosen.slice(0, limit).map((row) => {
      const identity = row[at.identity], open = () => change({ cell: identity });
      return make("tr", { "data-cell": identity, on: { click: open } }, ...shown.map((name, place) => {
        const content = digits(row[at[name]]);
        const inner = place === 0 && runs[identity]
          ? make("button", { type: "button", on: { click: (event) => { event.stopPropagation(); open(); } } }, content) : content;
        return make("td", { class: numeric.has(name) ? "n" : name === "reason" ? "reason" : null }, inner);
      }));
    });
    document.getElementById("table").replaceChildren(make("thead", {}, head), make("tbody", {}, ...body));
    document.getElementById("more").hidden = chosen.length <= limit;
    opened(view.get("cell"));
  };
  document.getElementById("more").addEventListener("click", () => { limit += page; draw(); });

  const summary = (chosen) => {
    const piles = new Map();
    for (const row of chosen) {
      if (row[at.mape] === null) continue;
      if (!piles.has(row[at.method])) piles.set(row[at.method], []);
      piles.get(row[at.method]).push(row[at.mape]);
    }
    const lines = [...piles].map(([method, values]) => {
      values.sort((a, b) => a - b);
      const mean = values.reduce((a, b) => a + b, 0) / values.length;
      const spread = Math.sqrt(values.reduce((a, b) => a + (b - mean) ** 2, 0) / Math.max(values.length - 1, 1));
      const middle = (values[Math.floor((values.length - 1) / 2)] + values[Math.ceil((values.length - 1) / 2)]) / 2;
      return [method, values.length, mean, spread, middle, values[values.length - 1]];
    });
    document.getElementById("summary").replaceChildren(
      make("thead", {}, make("tr", {}, ...["Selected cells by method", "Cells", "Mean MAPE / %", "Deviation", "Median", "Worst"].map(
        (title, place) => make("th", { class: place ? "n" : null }, title)))),
      make("tbody", {}, ...lines.map((line) => make("tr", {}, ...line.map(
        (value, place) => make("td", { class: place ? "n" : null }, digits(value)))))));
  };

  const dialog = document.getElementById("run");
  dialog.addEventListener("close", () => change({ cell: "" }));
  const opened = (identity) => {
    const row = identity && rows.find((candidate) => candidate[at.identity] === identity);
    if (!row) { if (dialog.open) dialog.close(); return; }
    if (dialog.open && dialog.dataset.cell === identity) return;
    const told = runs[identity] || {};
    dialog.dataset.cell = identity;
    dialog.replaceChildren(
      make("button", { type: "button", class: "close", on: { click: () => dialog.close() } }, "Close"),
      make("h2", { id: "run-title" }, `${row[at.task]} · ${row[at.method]} · seed ${row[at.seed]}`),
      make("p", { class: "meta" }, `${row[at.state]} (${row[at.status] || row[at.reason] || "not run"}), ` +
        `MAPE ${digits(row[at.initial_mape])} → ${digits(row[at.mape])} %, ${digits(row[at.simulations])} simulations; ${identity}`),
      ...(told.report ? [make("p", {}, make("a", { href: told.report }, "The run's full report, with its curves"))] : []),
      ...(told.trace ? [trace(told.trace)] : [make("p", {}, told.report ? "" : "The page holds no rounds of this cell.")]),
      ...(told.notes || []).map((note) => make("p", { class: "meta" }, note)),
      make("ol", {}, ...(told.rounds || []).map((round) => make("li", {},
        make("p", { class: "meta" }, `${round.phase} ${round.number}, ${round.simulations} simulation${round.simulations === 1 ? "" : "s"}: ` +
          (round.best === null ? "no result" : digits(round.best)) + (round.improved ? ", better" : "")),
        make("p", {}, round.words), ...(round.updates ? [make("p", {}, make("code", {}, round.updates))] : [])))),
      ...(told.parameters ? [make("table", {}, make("thead", {}, make("tr", {}, ...["Parameter", "Before", "Best"].map(
        (title) => make("th", {}, title)))), make("tbody", {}, ...told.parameters.map((line) => make("tr", {}, ...line.map(
        (value) => make("td", {}, value))))))] : []));
    if (!dialog.open) dialog.showModal();
  };

  const trace = (values) => {
    const space = "http://www.w3.org/2000/svg";
    const drawn = (tag, attributes) => {
      const element = document.createElementNS(space, tag);
      for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
      return element;
    };
    const known = values.filter((value) => value !== null && value > 0);
    const svg = drawn("svg", { viewBox: "0 0 800 150", preserveAspectRatio: "none", role: "img", "aria-label": "objective by simulation, logarithmic" });
    if (!known.length) return svg;
    const low = Math.log10(Math.min(...known)), high = Math.log10(Math.max(...known));
    const x = (place) => 10 + (780 * place) / Math.max(values.length - 1, 1);
    const y = (value) => 140 - (130 * (Math.log10(value) - low)) / Math.max(high - low, 1e-9);
    let best = Infinity;
    const points = [];
    values.forEach((value, place) => {
      if (value === null || value <= 0) return;
      svg.append(drawn("circle", { cx: x(place), cy: y(value), r: 3 }));
      best = Math.min(best, value);
      points.push(`${x(place)},${y(best)}`);
    });
    svg.append(drawn("polyline", { points: points.join(" ") }));
    return svg;
  };

  addEventListener("hashchange", draw);
  draw();
})();
