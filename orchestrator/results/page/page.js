"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const bytes = (packed) => Uint8Array.from(atob(packed), (c) => c.charCodeAt(0)).buffer;
  const floats = (packed) => new Float32Array(bytes(packed));
  const shorts = (packed) => new Int16Array(bytes(packed));
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const number = (x, digits) => Number(x).toPrecision(digits || 4).replace(/\.?0+$/, "").replace("-", "\u2212");
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const narrow = () => window.innerWidth < 560;
  const PAPER = { zoom: 0.7, half: 338, whole: 700, height: 155, wide: 185, tall: 250 }; // pixels on A4; zoom as in page.css
  const TICKS = [-3, -2, -1, 0, 1, 2, 3].flatMap((power) => [1, 2, 5].map((digit) => Number(`${digit}e${power}`))); // of a log axis
  let seek = () => {};

  // --- charts ---------------------------------------------------------------------------------------

  const axis = (title, more) => ({
    title: { text: title, font: { size: 12 }, standoff: 8 },
    gridcolor: colour("line"), zerolinecolor: colour("line"), linecolor: colour("line"), automargin: true, exponentformat: "power",
    tickfont: { size: 11 }, ...more,
  });

  const layout = (more) => ({
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colour("muted") },
    margin: { l: 52, r: 12, t: 26, b: 42 }, hovermode: "closest",
    hoverlabel: { bgcolor: colour("surface"), bordercolor: colour("line"), font: { color: colour("ink") } },
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 12, color: colour("ink") } },
    ...more,
  });

  const sectioned = (chart) => {
    const shapes = [], annotations = [];
    const known = narrow() ? { "lower run": "lower", "upper run": "upper", sprocket: "", idler: "" } : {};
    chart.sections.forEach(([start, end, name], k) => {
      if (k % 2 === 0) {
        shapes.push({ type: "rect", xref: "x", yref: "paper", x0: start, x1: end, y0: 0, y1: 1, line: { width: 0 },
          fillcolor: colour("band"), layer: "below" });
      }
      annotations.push({ x: 0.5 * (start + end), y: 0, yref: "paper", yanchor: "bottom", text: known[name] ?? name,
        showarrow: false, font: { size: 11, color: colour("muted") } });
    });
    return { shapes, annotations };
  };

  const unit = (title) => (title.includes(", ") ? ` ${title.split(", ").pop()}` : ""); // of an axis

  const hidden = (chart, trace) => [...document.querySelectorAll(".key .off")].some((entry) =>
    entry.dataset.trace === trace && entry.dataset.charts.split(" ").includes(chart));

  const lines = (chart, key) => {
    const curve = (trace, of, more) => ({
      type: "scatter", mode: trace.points ? "lines+markers" : "lines", name: trace.name, legendgroup: trace.name,
      visible: hidden(key, trace.name) ? "legendonly" : true,
      x: Array.from(floats(of.t)), y: Array.from(floats(of.y)),
      line: trace.reference
        ? { color: colour("ink"), width: 1.2, dash: ["dash", "dot", "dashdot", "longdash"][trace.colour % 4] }
        : { color: colour(`c${trace.colour % 6}`), width: trace.behind ? 4 : 1.5 },
      marker: { size: 4 }, opacity: trace.behind ? 0.45 : 1,
      hovertemplate: `%{y:.4g}${unit(chart.y)}<br>${chart.x.split(",")[0]} %{x:.4g}${unit(chart.x)}<extra>${trace.name}</extra>`,
      ...more,
    });
    const bands = chart.traces.filter((trace) => trace.mean); // every recorded extreme, light, under the means
    const traces = bands.map((trace) => curve({ ...trace, behind: false }, trace, { opacity: 0.3, showlegend: false }))
      .concat(chart.traces.map((trace) => curve(trace, trace.mean || trace, trace.mean
        ? { hovertemplate: `%{y:.4g}${unit(chart.y)}<br>time %{x:.4g} s<extra>${trace.name}, mean</extra>` } : {})));
    if (chart.banded) { // two entries of the legend that say what line and band are
      const entry = (name, look) => traces.push({ type: "scatter", mode: "lines", name, x: [null], y: [null], hoverinfo: "skip",
        line: { color: colour("muted"), width: 1.5 }, ...look });
      entry(`line: mean over ${narrow() ? chart.window.replace(" at top speed", "") : chart.window}`, {});
      entry("light: least to most", { line: { color: colour("muted"), width: 6 }, opacity: 0.3 });
    }
    if (chart.mark) {
      traces.push({ type: "scatter", mode: "markers", x: [chart.mark[0]], y: [chart.mark[1]], hoverinfo: "skip", cliponaxis: false,
        showlegend: false, marker: { size: 10, color: "rgba(0,0,0,0)", line: { width: 2, color: colour("bad") } } });
    }
    const range = chart.timed ? { range: data.span } : {}, named = chart.named || chart.banded;
    const y = chart.equal ? { scaleanchor: "x", scaleratio: 1 } : chart.flat ? { range: chart.flat }
      : chart.log ? { type: "log", tickvals: TICKS, ticktext: TICKS.map(String) } : {};
    return [traces, layout({ xaxis: axis(chart.x, range), yaxis: axis(chart.y, y), ...sectioned(chart),
      showlegend: named, margin: { l: 52, r: 12, t: named ? 28 : 10, b: 42 } })];
  };

  const waterfall = (chart) => {
    const hues = { work: "c0", stored: "c2", lost: "c1", open: "bad" }, bases = [];
    let left = 0; // of the work, above a bar
    chart.values.forEach((value, k) => {
      const role = chart.roles[k];
      bases.push(role === "work" || role === "open" ? 0 : left - value);
      left = role === "work" ? value : left - value;
    });
    const ends = bases.flatMap((base, k) => [base, base + chart.values[k]]);
    const low = Math.min(0, ...ends), high = Math.max(0, ...ends), room = (narrow() ? 0.2 : 0.1) * (high - low);
    const labels = chart.labels.map((label) => (narrow() ? label.replace(": ", ":<br>") : label));
    const bars = {
      type: "bar", orientation: "h", y: labels, x: chart.values, base: bases, showlegend: false,
      marker: { color: chart.roles.map((role) => colour(hues[role])) },
      hovertemplate: `%{y}: %{customdata}${unit(chart.x)}<extra></extra>`, customdata: chart.values.map((x) => number(x, 4)),
    };
    const words = chart.values.map((value, k) => ({ // beside the bar, where there is room
      x: Math.max(bases[k], bases[k] + value), y: labels[k], text: number(value, 3), xanchor: "left", showarrow: false,
      xshift: 4, font: { size: 12, color: colour("ink") },
    }));
    return [[bars], layout({ xaxis: axis(chart.x, { range: [low - 0.02 * (high - low), high + room] }),
      yaxis: axis("", { autorange: "reversed", tickfont: { size: 12, color: colour("ink") } }), annotations: words,
      margin: { l: 20, r: 12, t: 8, b: 42 }, bargap: 0.35 })];
  };

  const choice = (name) => document.querySelector(`select[data-chart="${name}"]`)?.value || "run";

  const heat = (chart, name) => {
    const t = Array.from(floats(chart.t)), shown = choice(name), rows = [];
    const own = floats(chart.values), other = chart.reference && floats(chart.reference), apart = shown === "difference";
    const values = apart ? own.map((x, k) => x - other[k]) : shown === "reference" ? other : own;
    const sizes = (apart ? [values] : other ? [own, other] : [own]).flatMap((all) => Array.from(all)).filter(Number.isFinite);
    const most = sizes.reduce((one, x) => Math.max(one, apart ? Math.abs(x) : x), 0);
    const least = apart ? -most : sizes.reduce((one, x) => Math.min(one, x), Infinity); // one scale for run and reference
    for (let link = 0; link < chart.links; link++) {
      rows.push(Array.from(values.subarray(link * t.length, (link + 1) * t.length), (x) => (Number.isNaN(x) ? null : x)));
    }
    const trace = {
      type: "heatmap", x: t, y: Array.from({ length: chart.links }, (_, k) => k + 1), z: rows,
      colorscale: apart ? "RdBu" : "Viridis", zmin: least, zmax: most,
      colorbar: { title: { text: chart.z, side: "right", font: { size: 12 } }, thickness: 12, outlinewidth: 0, tickfont: { size: 11 } },
      hovertemplate: `link %{y}, %{x:.4g} s<br>%{z:.4g}${unit(chart.z)}<extra>${other ? shown : ""}</extra>`, zsmooth: false,
    };
    const traces = [trace], annotations = [];
    if (chart.mark && shown === "run") {
      const [when, link, word] = chart.mark;
      traces.push({ type: "scatter", mode: "markers", x: [when], y: [link], hoverinfo: "skip", showlegend: false,
        marker: { size: 14, color: "rgba(0,0,0,0)", line: { width: 2.5, color: "#ff5a4f" } } });
      annotations.push({ x: when, y: link, text: word, showarrow: true, arrowhead: 0, arrowcolor: "#ff5a4f", ax: when > 0.5 * (data.span[0] + data.span[1]) ? -60 : 60,
        ay: link > 0.5 * chart.links ? 34 : -34, font: { size: 12, color: "#ffffff" }, bgcolor: "rgba(20,24,28,0.78)", borderpad: 3 });
    }
    return [traces, layout({ xaxis: axis(chart.x, { showgrid: false, range: data.span }), yaxis: axis(chart.y, { showgrid: false }),
      annotations, margin: { l: 46, r: 8, t: 8, b: 42 } })];
  };

  const kinds = { lines, waterfall, heat };
  const config = { displaylogo: false, responsive: true, displayModeBar: false, showSendToCloud: false };

  const draw = (name, chart) => {
    const place = document.getElementById(`chart-${name}`);
    if (!place) return;
    place.classList.toggle("banded", Boolean(chart.banded)); // its legend needs two more rows
    const [traces, look] = kinds[chart.kind](chart, name);
    Plotly.react(place, traces, look, config).then(() => {
      if (place.dataset.told || !(chart.timed || chart.kind === "heat")) return;
      place.dataset.told = "yes";
      place.on("plotly_click", (event) => seek(event.points[0].x, true));
    });
  };
  document.querySelectorAll("select[data-chart]").forEach((select) => select.addEventListener("change",
    () => draw(select.dataset.chart, data.charts[select.dataset.chart])));
  document.querySelectorAll(".key button").forEach((entry) => entry.addEventListener("click", () => {
    entry.classList.toggle("off");
    entry.dataset.charts.split(" ").forEach((name) => draw(name, data.charts[name]));
  }));
  const drawAll = () => Object.entries(data.charts).forEach(([name, chart]) => draw(name, chart));

  // --- side view ------------------------------------------------------------------------------------

  const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
  const mixed = VIRIDIS.map((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16)));
  const viridis = (share) => {
    const place = Math.max(0, Math.min(1, share || 0)) * (mixed.length - 1);
    const k = Math.min(Math.floor(place), mixed.length - 2);
    return `rgb(${mixed[k].map((low, i) => Math.round(low + (place - k) * (mixed[k + 1][i] - low))).join(",")})`;
  };

  const brush = (pen) => { // draws through points (x, y), in pixels; looks are those of CSS
    const path = (points) => {
      pen.beginPath();
      points.forEach(([x, y]) => pen.lineTo(x, y));
    };
    const line = (points, look, thick, closed) => {
      path(points);
      if (closed) pen.closePath();
      pen.strokeStyle = look;
      pen.lineWidth = thick;
      pen.stroke();
    };
    const area = (points, look) => {
      path(points);
      pen.fillStyle = look;
      pen.fill();
    };
    return { path, line, area };
  };

  const fromAbove = (view) => {
    const canvas = document.getElementById("above"), pen = canvas.getContext("2d"), [along, across] = view.half;
    const hull = floats(view.hull), heading = floats(view.heading), feet = shorts(view.feet), arrows = shorts(view.arrows);
    const first = view.counts.reduce((sums, count) => [...sums, sums[sums.length - 1] + count], [0]);
    const { line, area } = brush(pen);
    return (k) => {
      const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = Math.min(0.5 * width, 400);
      canvas.style.height = `${height}px`;
      [canvas.width, canvas.height] = [width * ratio, height * ratio];
      const scale = height / 2 / view.reach, [hx, hy] = [hull[2 * k], hull[2 * k + 1]], wide = 0.5 * width / scale;
      const at = (x, y) => [0.5 * width + scale * x, 0.5 * height - scale * y]; // metres beside the hull
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      for (let x = Math.ceil(hx - wide); x <= hx + wide; x++) line([at(x - hx, view.reach), at(x - hx, -view.reach)], colour("line"), 1);
      for (let y = Math.ceil(hy - view.reach); y <= hy + view.reach; y++) line([at(wide, y - hy), at(-wide, y - hy)], colour("line"), 1);
      line(view.counts.map((_, i) => at(hull[2 * i] - hx, hull[2 * i + 1] - hy)), colour("muted"), 1);
      const c = Math.cos(heading[k]), s = Math.sin(heading[k]), shade = colour("c0");
      pen.globalAlpha = 0.35;
      for (let i = first[k]; i < first[k + 1]; i++) {
        const x = feet[2 * i] * view.unit, y = feet[2 * i + 1] * view.unit;
        area([[1, 1], [1, -1], [-1, -1], [-1, 1]].map(([p, q]) => {
          const [a, b] = [p * along, q * across];
          return at(x + c * a - s * b, y + s * a + c * b);
        }), shade);
      }
      pen.globalAlpha = 1;
      const arrow = (x, y, u, v) => {
        const size = Math.hypot(u, v), [tx, ty] = [x + u, y + v], head = Math.min(0.1, 0.4 * size) / size;
        if (size < 0.02) return;
        line([at(x, y), at(tx, ty)], colour("bad"), 1.3);
        line([at(tx - head * (u - 0.5 * v), ty - head * (v + 0.5 * u)), at(tx, ty), at(tx - head * (u + 0.5 * v), ty - head * (v - 0.5 * u))], colour("bad"), 1.3);
      };
      for (let i = first[k]; i < first[k + 1]; i++) {
        arrow(...[feet, arrows].flatMap((pairs) => [pairs[2 * i] * view.unit, pairs[2 * i + 1] * view.unit]));
      }
      const { length, label } = view.scale, corner = view.reach - 12 / scale;
      arrow(-wide + 4 / scale, -corner, length, 0);
      pen.beginPath();
      pen.arc(...at(0, 0), 4, 0, 2 * Math.PI);
      pen.fillStyle = colour("ink");
      pen.fill();
      pen.font = `600 14px ${getComputedStyle(document.body).fontFamily}`;
      pen.fillText(label, ...at(-wide + 10 / scale + length, -corner - 5 / scale));
      pen.fillText(`arrows: force of the ground on a link, up to ${number(1e-3 * view.largest, 3)} kN`, 2, 16);
    };
  };

  const player = (view) => {
    const above = view.above ? fromAbove(view.above) : () => {};
    const canvas = document.getElementById("picture"), pen = canvas.getContext("2d"), { path, line, area } = brush(pen);
    const slider = document.getElementById("time"), clock = document.getElementById("clock");
    const button = document.getElementById("play"), pace = document.getElementById("pace");
    const t = floats(view.t), pins = shorts(view.pins), tension = floats(view.tension);
    const wheels = view.wheels.map((wheel) => ({ ...wheel, centre: shorts(wheel.centre), angle: floats(wheel.angle) }));
    const hull = view.hull && shorts(view.hull), corners = hull ? hull.length / 2 / view.pictures : 0;
    const reference = view.reference && shorts(view.reference.pins);
    const along = view.ground && floats(view.ground.along), speed = view.speed && floats(view.speed);
    const linesOf = (table) => { // sections of the ground, one for each picture
      if (!table?.sections) return null;
      const first = [0];
      table.counts.forEach((count) => first.push(first.at(-1) + count));
      return { places: floats(table.sections), first };
    };
    const sections = linesOf(view.ground), untouched = linesOf(view.ground?.untouched);
    const [left, bottom] = view.low, [right, top] = view.high;
    let now = 0, playing = false, began = 0, from = 0, scale = 1, ox = 0, oy = 0, width = 0, height = 0;
    slider.max = view.pictures - 1;
    document.getElementById("coloured").textContent = view.label;
    document.getElementById("least").textContent = number(view.least, 3);
    document.getElementById("most").textContent = number(view.most, 3);
    document.getElementById("scale").style.background = `linear-gradient(90deg, ${VIRIDIS.join(",")})`;
    document.getElementById("viewed").textContent =
      `The ${view.track.replaceAll("_", " ")} seen from the vehicle's right; ahead is to the right. ${view.pictures} pictures` +
      (view.pictures > 1 ? `, one every ${number((t[t.length - 1] - t[0]) / (view.pictures - 1), 2)} s.` : ".") +
      (view.ground ? " Marks on the ground are 1 m apart." : "") +
      (untouched ? " Dashed: the ground before the track came." : "") +
      (view.above ? " From above: both tracks about the hull's centre of mass and its way; the squares are 1 m wide." : "") +
      (reference ? " The thin line is the chain of the reference at the same time; each is seen from its own sprocket." : "");

    const size = () => {
      const ratio = window.devicePixelRatio || 1;
      width = canvas.clientWidth;
      height = Math.round(Math.min(Math.max(width * (top - bottom) / (right - left), 0.25 * width), 0.6 * width, 520));
      canvas.style.height = `${height}px`;
      canvas.width = width * ratio;
      canvas.height = height * ratio;
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      scale = Math.min(width / (right - left), height / (top - bottom));
      ox = 0.5 * (width - scale * (left + right));
      oy = 0.5 * (height + scale * (top + bottom));
    };
    const X = (x) => ox + scale * x, Y = (y) => oy - scale * y;
    const placed = (places, count, k) => Array.from({ length: count }, (_, i) => // those of a picture
      [X(places[2 * (k * count + i)] * view.unit), Y(places[2 * (k * count + i) + 1] * view.unit)]);

    const lineAt = ({ places, first }, k) => { // in the picture
      const points = [];
      for (let i = first[k]; i < first[k + 1]; i++) points.push([X(places[2 * i]), Y(places[2 * i + 1])]);
      return points;
    };

    const heightOf = (points, x) => {
      const k = Math.min(Math.max(points.findIndex(([px]) => px >= x), 1), points.length - 1);
      const [[ax, ay], [bx, by]] = [points[k - 1], points[k]];
      return ay + (by - ay) * (x - ax) / (bx - ax);
    };

    const soil = (k) => {
      const shift = along[k], corners = () => view.ground.corners.map(([a, z]) => [X(a - shift), Y(z)]);
      const points = sections ? lineAt(sections, k) : [[0, Y(0)], ...corners(), [width, Y(0)]];
      const edge = colour("soil-edge");
      area([...points, [width, height], [0, height]], colour("soil"));
      const first = Math.ceil((0 - ox) / scale + shift), last = Math.floor((width - ox) / scale + shift);
      for (let mark = first; mark <= last; mark++) {
        const x = X(mark - shift), y = sections ? heightOf(points, x) + 0.02 * scale : Y(-0.02);
        line([[x, y], [x, y + 8]], edge, 1);
      }
      line(points, edge, 1);
      if (!untouched) return;
      pen.setLineDash([6, 4]);
      line(lineAt(untouched, k), edge, 1);
      pen.setLineDash([]);
    };

    const outline = (wheel, k, x, y) => {
      const c = scale * Math.cos(wheel.angle[k]), n = scale * Math.sin(wheel.angle[k]);
      path(wheel.outline.map(([ahead, up]) => [x + c * ahead - n * up, y - n * ahead - c * up]));
      if (!wheel.outline.length) pen.arc(x, y, scale * wheel.radius, 0, 2 * Math.PI);
      pen.closePath();
    };

    const drawParts = (kind, at) => { // of all links; in the frame of a link, along and outwards
      for (const part of view.parts.filter((each) => each.kind === kind)) for (let i = 0; i < view.links; i++) {
        pen.fillStyle = `rgb(${part.colour.join(",")})`;
        const [ax, ay] = at[i], [bx, by] = at[(i + 1) % view.pinCount];
        pen.save();
        pen.translate(0.5 * (ax + bx), 0.5 * (ay + by));
        pen.rotate(Math.atan2(by - ay, bx - ax));
        pen.scale(scale, -scale);
        pen.fillRect(part.low[0], part.low[1], part.high[0] - part.low[0], part.high[1] - part.low[1]);
        pen.restore();
      }
    };

    const paint = () => {
      const k = now, at = placed(pins, view.pinCount, k);
      pen.clearRect(0, 0, width, height);
      if (view.ground) soil(k);
      if (hull) area(placed(hull, corners, k), colour("hull"));
      drawParts("horn", at); // between the discs of wheels
      const edge = colour("wheel-edge");
      wheels.forEach((wheel) => {
        const [[x, y]] = placed(wheel.centre, 1, k);
        outline(wheel, k, x, y);
        pen.fillStyle = colour("wheel");
        pen.fill();
        pen.strokeStyle = edge;
        pen.lineWidth = 1.2;
        pen.stroke();
        const reach = 0.7 * scale * wheel.radius;
        for (let spoke = 0; spoke < 3; spoke++) {
          const angle = wheel.angle[k] + 2 * Math.PI * spoke / 3;
          line([[x, y], [x + reach * Math.cos(angle), y - reach * Math.sin(angle)]], edge, 1.2);
        }
      });
      let most = -Infinity, worst = 0;
      pen.lineCap = "butt";
      for (let i = 0; i < view.links; i++) {
        const [ax, ay] = at[i], [bx, by] = at[(i + 1) % view.pinCount], pull = tension[k * view.links + i];
        if (pull > most) [most, worst] = [pull, i];
        const gap = 0.5 * (1 - view.drawn);
        const ends = [[ax + gap * (bx - ax), ay + gap * (by - ay)], [bx - gap * (bx - ax), by - gap * (by - ay)]];
        line(ends, viridis((pull - view.least) / (view.most - view.least)), Math.max(2.5, view.thick * scale));
      }
      drawParts("pad", at);
      if (reference && k < view.reference.pictures) {
        line(placed(reference, view.reference.pinCount, k), colour("outline"), 1.4, view.reference.closed);
      }
      const [ax, ay] = at[worst], [bx, by] = at[(worst + 1) % view.pinCount];
      pen.beginPath();
      pen.arc(0.5 * (ax + bx), 0.5 * (ay + by), Math.max(9, 0.11 * scale), 0, 2 * Math.PI);
      pen.strokeStyle = colour("bad");
      pen.lineWidth = 2;
      pen.stroke();
      const words = [`link ${worst + 1} bears ${number(most, 3)} kN`];
      if (speed) words.unshift(`${number(Math.abs(speed[k]) < 5e-4 ? 0 : speed[k], 3)} m/s`);
      pen.fillStyle = colour("ink");
      pen.font = `600 14px ${getComputedStyle(document.body).fontFamily}`;
      pen.fillText(words.join("   "), 2, 16);
      above(k);
      clock.textContent = `${t[k].toFixed(2)} s`;
      slider.value = k;
      slider.setAttribute("aria-valuetext", clock.textContent);
    };

    const show = (k) => {
      now = Math.max(0, Math.min(view.pictures - 1, k));
      paint();
    };
    const stop = () => {
      playing = false;
      button.textContent = "Play";
    };
    const start = () => {
      if (now === view.pictures - 1) now = 0;
      playing = true;
      button.textContent = "Pause";
      [began, from] = [performance.now(), t[now]];
      requestAnimationFrame(tick);
    };
    const nearest = (moment) => {
      let k = 0;
      while (k < view.pictures - 1 && Math.abs(t[k + 1] - moment) <= Math.abs(t[k] - moment)) k++;
      return k;
    };
    const tick = (stamp) => {
      if (!playing) return;
      const moment = from + Math.max(0, stamp - began) / 1e3 * Number(pace.value);
      let k = now;
      while (k < view.pictures - 1 && t[k + 1] <= moment) k++;
      if (k !== now) show(k);
      if (k === view.pictures - 1) stop();
      else requestAnimationFrame(tick);
    };
    const toggle = () => (playing ? stop() : start());
    button.addEventListener("click", toggle);
    pace.addEventListener("change", () => { [began, from] = [performance.now(), t[now]]; });
    slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
    document.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -1, ArrowRight: 1 }[event.code];
      if (way && !event.target.closest("input, select")) {
        stop();
        show(now + way);
      }
      if (event.code !== "Space" || event.target.closest("button, select, summary, a")) return;
      event.preventDefault();
      toggle();
    });
    seek = (moment, jump) => {
      stop();
      show(nearest(moment));
      if (jump) document.getElementById("picture").scrollIntoView({ block: "center" });
    };
    const fit = () => { if (canvas.clientWidth !== width) { size(); paint(); } };
    new ResizeObserver(() => requestAnimationFrame(fit)).observe(canvas);
    dark.addEventListener("change", paint);
    size();
    show(nearest(data.figures.tension ? data.figures.tension.t : 0));
  };

  // --- the page -------------------------------------------------------------------------------------

  if (data.player) player(data.player);
  drawAll();
  dark.addEventListener("change", drawAll);
  const everyChart = (look) => document.querySelectorAll(".chart").forEach((place) => Plotly.relayout(place, look(place)));
  const onPaper = (place) => ({
    width: (place.closest(".grid") ? PAPER.half : PAPER.whole) / PAPER.zoom,
    height: PAPER[["wide", "tall"].find((size) => place.classList.contains(size)) || "height"] / PAPER.zoom,
  });
  let opened = [];
  window.addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach((part) => { part.open = true; });
    everyChart(onPaper);
  });
  window.addEventListener("afterprint", () => {
    opened.forEach((part) => { part.open = false; });
    everyChart(() => ({ width: null, height: null, autosize: true }));
  });
  const links = new Map([...document.querySelectorAll("nav a")].map((link) => [link.hash.slice(1), link]));
  const watcher = new IntersectionObserver((seen) => seen.forEach((entry) => {
    const link = links.get(entry.target.id);
    if (link) link.classList.toggle("here", entry.isIntersecting);
  }), { rootMargin: "-20% 0px -70% 0px" });
  document.querySelectorAll("section").forEach((section) => watcher.observe(section));
})();
