"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const rows = data.rows;
  const table = document.getElementById("table");
  const entries = [...table.querySelectorAll("tbody.entry")];
  const STEP = 300;
  let limit = STEP;
  const order = entries.map((_, i) => i);
  const off = new Set();
  const query = document.getElementById("q");
  const byClass = document.getElementById("f-class");
  const byStorey = document.getElementById("f-storey");

  const make = (tag, attributes = {}, ...children) => {
    const node = document.createElement(tag);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    node.append(...children.filter((child) => child !== null));
    return node;
  };
  const draw = (tag, attributes, ...children) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    node.append(...children);
    return node;
  };
  const mm = (value, digits = 1, signed = false) => {
    if (value === null) return "–";
    const text = value.toFixed(digits);
    if (Number(text) === 0) return (0).toFixed(digits);
    return (signed && value > 0 ? "+" : "") + text.replace("-", "−");
  };
  const percent = (share) => {
    if (share === null) return "–";
    const value = share > 0 && share < 1 ? Math.min(Math.max(100 * share, 1), 99) : 100 * share;
    return value.toFixed(0) + " %";
  };

  // Filtering
  const text = rows.map((r) => [r.name, r.class, r.type, r.id, r.storey].join("\n").toLowerCase());
  const fits = (i) => {
    const r = rows[i];
    const words = query.value.toLowerCase().split(/\s+/).filter(Boolean);
    return !off.has(r.status) && words.every((word) => text[i].includes(word))
      && (!byClass.value || r.class === byClass.value)
      && (!byStorey || !byStorey.value || "=" + r.storey === byStorey.value);
  };
  const show = () => {
    let matching = 0;
    for (const i of order) {
      const fit = fits(i);
      matching += fit;
      entries[i].hidden = !fit || matching > limit;
    }
    document.getElementById("shown").textContent = matching === rows.length ? `${rows.length} elements` : `${matching} of ${rows.length} elements`;
    document.getElementById("nothing").hidden = matching > 0;
    document.getElementById("more").hidden = matching <= limit;
    document.getElementById("show-more").textContent = `Show more (${matching - limit} left)`;
  };
  const chips = [...document.querySelectorAll(".chip")];
  const setStatuses = (visible) => {
    off.clear();
    for (const chip of chips) {
      const on = visible(chip.dataset.status);
      chip.setAttribute("aria-pressed", String(on));
      if (!on) off.add(chip.dataset.status);
    }
    show();
  };
  const reset = () => {
    query.value = "";
    byClass.value = "";
    if (byStorey) byStorey.value = "";
    limit = STEP;
    setStatuses(() => true);
  };
  for (const chip of chips) {
    chip.addEventListener("click", () => {
      const pressed = chip.getAttribute("aria-pressed") === "true";
      setStatuses((status) => (status === chip.dataset.status ? !pressed : !off.has(status)));
    });
  }
  for (const tile of document.querySelectorAll("[data-filter-status]")) {
    tile.addEventListener("click", () => {
      reset();
      setStatuses((status) => status === tile.dataset.filterStatus);
      document.getElementById("elements").scrollIntoView();
    });
  }
  for (const input of [query, byClass, byStorey]) input?.addEventListener("input", show);
  document.getElementById("reset").addEventListener("click", reset);
  document.getElementById("reset2").addEventListener("click", reset);
  document.getElementById("show-more").addEventListener("click", () => { limit += STEP * 5; show(); });
  addEventListener("beforeprint", () => { limit = Infinity; show(); });
  addEventListener("afterprint", () => { limit = STEP; show(); });

  // Sorting: unknown values stay at the end in both directions.
  const severity = new Map(["ABSENT", "DEVIATING", "PARTIAL", "NOTOBSERVED", "CONFIRMED"].map((s, i) => [s, i]));
  const asked = data.levels.indexOf(data.required);
  const keys = {
    status: (r) => severity.get(r.status),
    name: (r) => r.name || null,
    storey: (r) => r.storey || null,
    coverage: (r) => r.coverage,
    occupied: (r) => r.occupied,
    median: (r) => r.median,
    p95: (r) => r.p95,
    shift: (r) => r.shift,
    achieved: (r) => Number(r.achieved.replace(/\D/g, "")) || 0,
    ratio: (r) => (r.observed ? r.ratio[asked] : null),
  };
  const collator = new Intl.Collator(undefined, { numeric: true, sensitivity: "base" });
  const headers = [...table.querySelectorAll("th[data-sort]")];
  for (const header of headers) {
    header.querySelector("button").addEventListener("click", () => {
      const textual = ["status", "name", "storey"].includes(header.dataset.sort);
      const now = header.getAttribute("aria-sort");
      const direction = now === "ascending" ? "descending" : now === "descending" ? "ascending" : textual ? "ascending" : "descending";
      for (const other of headers) other.removeAttribute("aria-sort");
      header.setAttribute("aria-sort", direction);
      const key = keys[header.dataset.sort];
      const sign = direction === "ascending" ? 1 : -1;
      order.sort((a, b) => {
        const x = key(rows[a]), y = key(rows[b]);
        if (x === null || y === null) return (x === null) - (y === null) || a - b;
        return sign * (typeof x === "string" ? collator.compare(x, y) : x - y) || a - b;
      });
      table.append(...order.map((i) => entries[i]));
      show();
    });
  }

  // Unfolding
  const stackBar = (share, kind) => draw("svg", { class: "stack", viewBox: "0 0 100 10", preserveAspectRatio: "none", "aria-hidden": "true" },
    draw("rect", { class: kind, width: (100 * share).toFixed(1), height: 10 }));
  const keyValues = (pairs) => make("dl", { class: "kv" }, ...pairs.flatMap(([key, value]) => [make("dt", {}, key), make("dd", {}, value)]));
  const ladder = (r) => make("div", { class: "rungs" }, ...data.levels.flatMap((level, k) => {
    const kind = level === data.required ? "asked" : "";
    return [
      make("span", { class: kind }, `LOA${level} ±${data.bounds[k]} mm`),
      stackBar(r.ratio[k] || 0, "accent"),
      make("span", { class: "r " + kind }, r.observed ? percent(r.ratio[k]) : "–"),
    ];
  }));
  const ramp = (share) => {
    const at = (Math.min(Math.max(share, -1), 1) + 1) / 2 * (data.stops.length - 1);
    return data.stops[Math.round(at)];
  };
  const histogram = (r) => {
    if (!r.histogram) return make("p", {}, "Nothing was measured near its planned surface.");
    const W = 380, H = 150, B = 24, bound = data.bounds[asked], top = Math.max(...r.histogram);
    const x = (value) => ((value + r.limit) / (2 * r.limit)) * W;
    const width = W / data.bins;
    const bars = r.histogram.map((share, k) => {
      const middle = -r.limit + ((k + 0.5) / data.bins) * 2 * r.limit;
      const height = (share / top) * (H - B - 8);
      return draw("rect", { x: (k * width + 0.5).toFixed(1), y: (H - B - height).toFixed(1), width: (width - 1).toFixed(1), height: height.toFixed(1), fill: ramp(middle / bound), class: share ? "bin" : "" },
        draw("title", {}, `about ${mm(middle, 1, true)} mm: ${(100 * share).toFixed(1)} % of its measured area`));
    });
    const band = draw("rect", { class: "band", x: Math.max(x(-bound), 0).toFixed(1), y: 1, width: (Math.min(x(bound), W) - Math.max(x(-bound), 0)).toFixed(1), height: H - B - 1 });
    const labels = [-1, -0.5, 0, 0.5, 1].map((f) => draw("text", { x: x(f * r.limit), y: H - 7, "text-anchor": f === -1 ? "start" : f === 1 ? "end" : "middle" }, f ? mm(f * r.limit, r.limit < 10 && f % 1 ? 1 : 0, true) : "0 mm"));
    return draw("svg", { class: "chart", viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": "Histogram of its deviations" },
      band, ...bars, draw("line", { class: "zero", x1: x(0), x2: x(0), y1: 1, y2: H - B }), ...labels);
  };
  const details = (r) => {
    const copy = make("button", { type: "button", class: "link copy" }, "copy");
    copy.addEventListener("click", () => navigator.clipboard?.writeText(r.id).then(() => { copy.textContent = "copied"; }));
    const vector = r.vector ? r.vector.map((v) => mm(v, 1, true)).join(", ") + " mm" : "–";
    const significance = r.significant === null ? "not determined" : r.significant ? "yes, at 95 %" : "no, within its uncertainty";
    return make("tr", { class: "details" }, make("td", { colspan: 11 },
      r.decision ? make("p", { class: "reason" }, make("b", {}, `Decided: ${data.labels[r.decision.status].toLowerCase()}. `), make("bdi", {}, r.decision.reason), ` (${r.decision.author || "a person"}, ${r.decision.date})`) : null,
      make("p", { class: "reason" }, r.decision ? make("b", {}, `Computed: ${data.labels[r.decision.computed].toLowerCase()}. `) : null, make("bdi", {}, r.reason)),
      make("div", { class: "cols" },
        make("div", {}, make("h4", {}, "Evidence"), keyValues([
          ["GlobalId", make("span", {}, make("span", { class: "code" }, r.id), copy)],
          ["Type", make("bdi", {}, r.type || "–")],
          ["Stations", make("bdi", {}, r.stations.join(", ") || "none")],
          ["Surface that can be seen", `${r.area.toFixed(2)} m²`],
          ["Positions seen", `${r.observed.toLocaleString("en")} of ${r.samples.toLocaleString("en")}`],
          ["Occupied, empty, unknown", [r.occupied, r.empty, r.unknown].map(percent).join(", ")],
          ["Conflict", percent(r.conflict)],
        ])),
        make("div", {}, make("h4", {}, "Confirmed at each level"), ladder(r), keyValues([
          ["Asked, reached", `${r.required}, ${r.achieved === "NONE" ? "none" : r.achieved}`],
          ["Shift x, y, z", vector],
          ["Shift", r.shift === null ? "not determined" : `${mm(r.shift)} ± ${mm(r.shiftSigma === null ? null : 1.96 * r.shiftSigma, 2)} mm (95 %)`],
          ["Significant", significance],
          ["Sigma measured, registration", `${mm(r.measurementSigma, 2)}, ${mm(r.registrationSigma, 2)} mm`],
        ])),
        make("div", {}, make("h4", {}, `Deviations, with LOA${data.required} shaded`), histogram(r)),
      )));
  };
  const toggle = (entry, open = !entry.classList.contains("open")) => {
    entry.classList.toggle("open", open);
    entry.querySelector(".unfold").setAttribute("aria-expanded", String(open));
    if (open && !entry.querySelector(".details")) entry.append(details(rows[entry.dataset.i]));
    else if (!open) entry.querySelector(".details")?.remove();
  };
  table.addEventListener("click", (event) => {
    const entry = event.target.closest("tbody.entry");
    if (entry && !event.target.closest(".details") && !String(getSelection())) toggle(entry);
  });
  const goTo = (i) => {
    if (!fits(i)) reset();
    if (entries[i].hidden) { limit = Infinity; show(); }
    toggle(entries[i], true);
    entries[i].scrollIntoView({ block: "center" });
    entries[i].classList.remove("flash");
    void entries[i].offsetWidth;
    entries[i].classList.add("flash");
    entries[i].querySelector(".unfold").focus({ preventScroll: true });
  };

  // Pictures
  for (const radio of document.querySelectorAll("input[name=mode]")) {
    radio.addEventListener("change", () => { document.body.dataset.mode = radio.value; });
    if (radio.checked) document.body.dataset.mode = radio.value;
  }
  const tip = document.getElementById("tip");
  const rowOf = new Map(rows.map((r, i) => [r.row, i]));
  const wire = (frame) => {
    let pixels = null;
    const load = () => {
      if (pixels) return;
      const image = new Image();
      image.addEventListener("load", () => {
        const canvas = make("canvas", { width: image.width, height: image.height });
        const context = canvas.getContext("2d", { willReadFrequently: true });
        context.drawImage(image, 0, 0);
        pixels = context.getImageData(0, 0, image.width, image.height);
      });
      image.src = frame.dataset.pick;
    };
    const under = (event) => {
      if (!pixels || event.target.closest(".zoom")) return undefined;
      const box = frame.getBoundingClientRect();
      const x = Math.floor(((event.clientX - box.left) / box.width) * pixels.width);
      const y = Math.floor(((event.clientY - box.top) / box.height) * pixels.height);
      if (x < 0 || y < 0 || x >= pixels.width || y >= pixels.height) return undefined;
      const at = 4 * (y * pixels.width + x);
      return rowOf.get(pixels.data[at] * 65536 + pixels.data[at + 1] * 256 + pixels.data[at + 2] - 1);
    };
    frame.addEventListener("pointerenter", load);
    frame.addEventListener("pointermove", (event) => {
      load();
      const i = under(event);
      frame.classList.toggle("pointing", i !== undefined);
      tip.hidden = i === undefined;
      if (i === undefined) return;
      const r = rows[i];
      const facts = [r.median === null ? null : `median ${mm(r.median, 1, true)} mm`, `${percent(r.coverage)} covered`].filter(Boolean);
      tip.replaceChildren(make("b", {}, make("bdi", {}, r.name || r.class)), make("span", {}, `${data.signs[r.status]} ${data.labels[r.status]}${r.decision ? " (decided)" : ""} · ${r.class}`), make("span", {}, facts.join(" · ")));
      (frame.closest("dialog") || document.body).append(tip);
      tip.style.left = Math.min(event.clientX + 16, innerWidth - tip.offsetWidth - 8) + "px";
      tip.style.top = Math.min(event.clientY + 16, innerHeight - tip.offsetHeight - 8) + "px";
    });
    frame.addEventListener("pointerleave", () => { tip.hidden = true; });
    frame.addEventListener("click", (event) => {
      const i = under(event);
      if (i === undefined) return;
      tip.hidden = true;
      frame.closest("dialog")?.close();
      goTo(i);
    });
  };
  const lightbox = document.getElementById("lightbox");
  for (const frame of document.querySelectorAll(".frame")) {
    wire(frame);
    frame.querySelector(".zoom").addEventListener("click", () => {
      const copy = frame.cloneNode(true);
      lightbox.querySelector(".box").replaceChildren(copy);
      wire(copy);
      lightbox.showModal();
    });
  }
  lightbox.addEventListener("click", (event) => { if (event.target === lightbox) lightbox.close(); });

  show();
  if (/^#e\d+$/.test(location.hash)) {
    const i = rowOf.get(Number(location.hash.slice(2)));
    if (i !== undefined) goTo(i);
  }
})();
