'use strict';
// Makes tables sortable, and panels of views in space turnable; without script tables and pictures stay as they are. (No less-than signs and
// ampersands here: the page is also well-formed XML.)
for (const table of document.querySelectorAll('table[data-sortable]')) {
  const heads = Array.from(table.tHead.rows[0].cells);
  const body = table.tBodies[0];
  const said = document.getElementById(table.dataset.sortable);
  const key = (row, i) => row.cells[i].dataset.sort || row.cells[i].textContent.trim();
  const order = new Intl.Collator('en', { numeric: true, sensitivity: 'base' });
  heads.forEach((head, i) => {
    const name = head.textContent;
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = name;
    head.replaceChildren(button);
    head.setAttribute('aria-sort', 'none');
    button.addEventListener('click', () => {
      const up = head.getAttribute('aria-sort') !== 'ascending';
      heads.forEach((other) => other.setAttribute('aria-sort', 'none'));
      head.setAttribute('aria-sort', up ? 'ascending' : 'descending');
      const rows = Array.from(body.rows);
      rows.sort((a, b) => (up ? 1 : -1) * order.compare(key(a, i), key(b, i)));
      body.append(...rows);
      said.textContent = 'Sorted by ' + name + (up ? ', ascending' : ', descending');
    });
  });
}

// Views in space. The data are whole numbers from 0 to 65535 along each side of a box, packed in base 64, little-endian.
const SIDE = 65535;
const unpack = (text) => {
  const raw = atob(text);
  const view = new DataView(Uint8Array.from(raw, (c) => c.charCodeAt(0)).buffer);
  return Array.from({ length: raw.length / 2 }, (unused, i) => view.getUint16(2 * i, true));
};
const element = (name, attributes, ...children) => {
  const made = document.createElement(name);
  Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
  made.append(...children);
  return made;
};
const LEGEND = {
  path: 'path', sliding: 'sliding', approach: 'the one way in', plus: 'ways out to h above 0', minus: 'ways out to h below 0',
  attracting: 'attracting', repelling: 'repelling', crossing: 'crossing',
};
const STEP = 7.5;
const whole = (number) => String(Math.round(number)).replace('-', '\u2212');

class Space {
  constructor(source) {
    this.data = JSON.parse(source.textContent);
    this.title = source.dataset.title;
    this.size = this.data.size;
    const point = (numbers, at) => [0, 1, 2].map((k) => this.size[k] * (numbers[at + k] / SIDE - 0.5));
    this.shapes = [];
    for (const [kind, text] of this.data.areas) {
      const numbers = unpack(text);
      for (let at = 0; numbers.length > at; at += 1 + 3 * numbers[at]) {
        this.shapes.push({ kind, area: true, corners: Array.from({ length: numbers[at] }, (unused, i) => point(numbers, at + 1 + 3 * i)) });
      }
    }
    for (const [kind, text] of this.data.lines) {
      const numbers = unpack(text);
      const points = Array.from({ length: numbers.length / 3 }, (unused, i) => point(numbers, 3 * i));
      points.slice(1).forEach((p, i) => this.shapes.push({ kind, area: false, corners: [points[i], p] }));
    }
    this.marks = this.data.marks.map((m) => point(m, 0));
    this.canvas = element('canvas', { role: 'img' });
    this.said = element('p', { class: 'turned', role: 'status' });
    this.box = element('div', { class: 'space-view', role: 'group', 'aria-label': 'View in space of ' + this.title });
    const button = (text, name, act) => {
      const made = element('button', { type: 'button', 'aria-label': name }, text);
      made.addEventListener('click', act);
      return made;
    };
    const tools = element('div', { class: 'tools' },
      button('\u2190', 'Turn left', () => this.turn(-STEP, 0)), button('\u2192', 'Turn right', () => this.turn(STEP, 0)),
      button('\u2191', 'Tilt up', () => this.turn(0, STEP)), button('\u2193', 'Tilt down', () => this.turn(0, -STEP)),
      button('+', 'Nearer', () => this.zoom(1.2)), button('\u2212', 'Farther', () => this.zoom(1 / 1.2)),
      button('As in the picture', 'As in the picture', () => this.reset()));
    const kinds = [...new Set(this.shapes.map((s) => s.kind))];
    const legend = element('ul', { class: 'legend' }, ...kinds.map((kind) => element('li', {}, element('span', { class: 'key ' + kind }), LEGEND[kind])));
    if (this.marks.length) legend.append(element('li', {}, element('span', { class: 'key mark' }), 'two-fold singularity'));
    this.box.append(this.canvas, tools, legend, this.said);
    this.listen();
    this.reset(true);
  }

  listen() {
    const keys = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
    this.box.addEventListener('keydown', (event) => {
      if (!keys[event.key]) return;
      event.preventDefault();
      this.turn(...keys[event.key]);
    });
    let held = null;
    this.canvas.addEventListener('pointerdown', (event) => {
      held = [event.clientX, event.clientY];
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener('pointermove', (event) => {
      if (!held) return;
      const [x, y] = held;
      held = [event.clientX, event.clientY];
      this.turn(0.4 * (x - event.clientX), 0.4 * (event.clientY - y), true);
    });
    for (const end of ['pointerup', 'pointercancel']) {
      this.canvas.addEventListener(end, () => {
        held = null;
        this.say();
      });
    }
    new ResizeObserver(() => this.plan()).observe(this.canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.plan());
  }

  reset(quiet) {
    [this.azimuth, this.elevation] = this.data.camera;
    this.scale = 1;
    this.plan();
    if (!quiet) this.say();
  }

  turn(azimuth, elevation, quiet) {
    this.azimuth = ((this.azimuth + azimuth + 540) % 360) - 180;
    this.elevation = Math.max(-90, Math.min(90, this.elevation + elevation));
    this.plan();
    if (!quiet) this.say();
  }

  zoom(factor) {
    this.scale = Math.max(0.5, Math.min(8, this.scale * factor));
    this.plan();
    this.say();
  }

  words() {
    return 'seen from azimuth ' + whole(this.azimuth) + '\u00b0, elevation ' + whole(this.elevation) + '\u00b0, ' + Math.round(100 * this.scale) + ' %';
  }

  say() {
    this.said.textContent = 'S' + this.words().slice(1) + '.';
    this.canvas.setAttribute('aria-label', this.title + ' in space, ' + this.words() + '; axes: ' + this.data.about + '. The picture above shows the same.');
  }

  plan() {
    if (!this.planned) this.planned = requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.planned = null;
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    if (!width) return;
    const sharp = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(width * sharp);
    this.canvas.height = Math.round(height * sharp);
    const c = this.canvas.getContext('2d');
    c.scale(sharp, sharp);
    const style = getComputedStyle(this.box);
    const colour = (name) => style.getPropertyValue('--' + name).trim();
    const [a, e] = [this.azimuth, this.elevation].map((d) => d * Math.PI / 180);
    const [sa, ca, se, ce] = [Math.sin(a), Math.cos(a), Math.sin(e), Math.cos(e)];
    const zoom = 0.68 * this.scale * Math.min(width, height);
    const see = ([x, y, z]) => [
      width / 2 + zoom * (ca * y - sa * x),
      height / 2 - zoom * (ce * z - se * (ca * x + sa * y)),
      ce * (ca * x + sa * y) + se * z,
    ];
    const outline = (corners) => {
      c.beginPath();
      corners.forEach((p, i) => (i ? c.lineTo(p[0], p[1]) : c.moveTo(p[0], p[1])));
    };
    c.lineJoin = c.lineCap = 'round';
    this.frame(c, see, colour);
    const seen = this.shapes.map((shape) => {
      const corners = shape.corners.map(see);
      return { shape, corners, depth: corners.reduce((sum, p) => sum + p[2], 0) / corners.length };
    });
    seen.sort((p, q) => p.depth - q.depth);
    for (const { shape, corners, depth } of seen) {
      outline(corners);
      if (shape.area) {
        c.closePath();
        c.globalAlpha = 0.55;
        c.fillStyle = colour(shape.kind);
        c.fill();
      } else {
        // Far parts are paler.
        c.globalAlpha = Math.max(0.35, Math.min(1, 0.75 + 0.5 * depth));
        c.strokeStyle = colour(shape.kind);
        c.lineWidth = ['sliding', 'approach'].includes(shape.kind) ? 2.2 : 0.9;
        c.stroke();
      }
    }
    c.globalAlpha = 1;
    for (const mark of this.marks.map(see)) {
      c.beginPath();
      c.arc(mark[0], mark[1], 4.5, 0, 2 * Math.PI);
      c.fillStyle = colour('mark');
      c.fill();
    }
  }

  // The box's edges, the ticks on three of them, and the axes' names.
  frame(c, see, colour) {
    const half = this.size.map((s) => s / 2);
    const corner = (i) => [0, 1, 2].map((k) => (Math.floor(i / 2 ** k) % 2 ? half[k] : -half[k]));
    c.strokeStyle = colour('line');
    c.lineWidth = 1;
    for (let i = 0; 8 > i; i++) {
      for (let k = 0; 3 > k; k++) {
        if (Math.floor(i / 2 ** k) % 2) continue;
        const [p, q] = [see(corner(i)), see(corner(i + 2 ** k))];
        c.beginPath();
        c.moveTo(p[0], p[1]);
        c.lineTo(q[0], q[1]);
        c.stroke();
      }
    }
    const middle = see([0, 0, 0]);
    c.font = '13px ' + getComputedStyle(this.box).fontFamily;
    c.textAlign = 'center';
    c.textBaseline = 'middle';
    c.fillStyle = colour('soft');
    this.data.axes.forEach((axis, k) => {
      // Of the four edges along this axis, the one whose middle lies lowest, or for the upright one furthest left.
      const [i, j] = [0, 1, 2].filter((other) => other !== k);
      const edges = [[-1, -1], [1, -1], [-1, 1], [1, 1]].map(([s, t]) => {
        const at = [0, 0, 0];
        at[i] = s * half[i];
        at[j] = t * half[j];
        return { at, seen: see(at) };
      });
      const edge = edges.reduce((best, other) => ((k === 2 ? best.seen[0] > other.seen[0] : other.seen[1] > best.seen[1]) ? other : best));
      const [dx, dy] = [edge.seen[0] - middle[0], edge.seen[1] - middle[1]];
      const far = Math.hypot(dx, dy) || 1;
      const label = (text, place, distance) => {
        const at = [...edge.at];
        at[k] = place;
        const p = see(at);
        c.fillText(text, p[0] + (distance * dx) / far, p[1] + (distance * dy) / far);
      };
      axis.ticks.forEach(([place, text]) => label(text, this.size[k] * (place / SIDE - 0.5), 16));
      c.font = 'italic ' + c.font;
      label(axis.name, 0, 40);
      c.font = c.font.replace('italic ', '');
    });
  }
}

for (const source of document.querySelectorAll('script.space')) {
  const button = element('button', { type: 'button', class: 'open', 'aria-expanded': 'false' }, 'Turn ' + (source.dataset.panel || 'it') + ' in space');
  let space = null;
  button.addEventListener('click', () => {
    if (!space) {
      space = new Space(source);
      button.after(space.box);
      space.say();
    } else {
      space.box.hidden = !space.box.hidden;
    }
    button.setAttribute('aria-expanded', String(!space.box.hidden));
  });
  source.after(button);
}
// On paper everything is open.
const opened = [];
addEventListener('beforeprint', () => document.querySelectorAll('details:not([open])').forEach((d) => {
  d.open = true;
  opened.push(d);
}));
addEventListener('afterprint', () => opened.splice(0).forEach((d) => (d.open = false)));
