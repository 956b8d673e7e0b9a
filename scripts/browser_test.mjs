// The report in a real browser: loads, no errors, nothing from the network, pictures there, sorting by keyboard, a forced mismatch
// shows its triptych, panels turn in space, no sideways scrolling on a phone, dark mode, contrast, works without script, no heading alone at the foot
// of a printed page. With --modules (see `make report-test`): no violation of axe-core's rules in any of these views, valid HTML by html-validate's.
//
//   node scripts/browser_test.mjs [--bins DIR] [--figures DIR] [--screenshots DIR] [--modules DIR] [--require]
//
// Needs Node 18 or later and a Chromium or Chrome (found on PATH, or named by $CHROMIUM); no npm packages: the browser is spoken to
// over a pipe. Without a browser that starts it says so and exits with 0, with --require with 1. --bins: where twofold
// is, target/release if not given. --figures: where figs 2 and 6 are, if they are not to be computed.
import { spawn, spawnSync, execFileSync } from 'node:child_process';
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { deflateSync } from 'node:zlib';

const root = resolve(dirname(fileURLToPath(import.meta.url)), '..');
const argument = (name) => {
  const at = process.argv.indexOf(name);
  return at < 0 ? null : process.argv[at + 1];
};
const shots = argument('--screenshots');
const modules = argument('--modules');

function findBrowser() {
  const names = ['chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable', 'chrome'];
  for (const name of process.env.CHROMIUM ? [process.env.CHROMIUM] : names) {
    const found = spawnSync(name, ['--version'], { encoding: 'utf8' });
    if (!found.error && found.status === 0) return { name, version: found.stdout.trim() };
  }
  return null;
}

// ---------------------------------------------------------------- a folder to report on, with one forced mismatch

function crc32(bytes) {
  let sum = ~0;
  for (const byte of bytes) {
    sum ^= byte;
    for (let k = 0; k < 8; k++) sum = sum & 1 ? 0xedb88320 ^ (sum >>> 1) : sum >>> 1;
  }
  return ~sum >>> 0;
}

// White with a dark square: as large as another picture, and not it.
function squarePng(width, height) {
  const rows = Buffer.alloc(height * (1 + width), 255);
  for (let y = 0; y < height; y++) {
    rows[y * (1 + width)] = 0;
    if (y > 50 && y < 250) rows.fill(40, y * (1 + width) + 50, y * (1 + width) + 250);
  }
  const chunk = (kind, data) => {
    const body = Buffer.concat([Buffer.from(kind, 'latin1'), data]);
    const out = Buffer.alloc(body.length + 8);
    out.writeUInt32BE(data.length, 0);
    body.copy(out, 4);
    out.writeUInt32BE(crc32(body), body.length + 4);
    return out;
  };
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header.set([8, 0, 0, 0, 0], 8);
  const magic = Buffer.from([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10]);
  return Buffer.concat([magic, chunk('IHDR', header), chunk('IDAT', deflateSync(rows)), chunk('IEND', Buffer.alloc(0))]);
}

function prepare(folder) {
  const bins = argument('--bins') ?? join(root, 'target', 'release');
  const binary = (name) => join(bins, name);
  for (const name of ['twofold']) {
    if (!existsSync(binary(name))) throw new Error(`${name} is not built; run: cargo build --release --bins`);
  }
  const figures = join(folder, 'made');
  const expected = join(folder, 'expected');
  const ready = argument('--figures');
  if (ready) ['fig2', 'fig6'].forEach((id) => cpSync(join(ready, id), join(figures, id), { recursive: true }));
  else execFileSync(binary('twofold'), ['figure', 'fig2', 'fig6', '--fresh', '--out', figures, '--quiet']);
  const { version } = JSON.parse(readFileSync(join(root, 'papers', 'jeffrey-2013', 'expected', 'fig6.json'), 'utf8'));
  let forced = null;
  // Beside the figures' folders there is making.json.
  for (const id of readdirSync(figures, { withFileTypes: true }).filter((entry) => entry.isDirectory()).map((entry) => entry.name)) {
    mkdirSync(join(expected, id), { recursive: true });
    const pictures = [];
    for (const file of readdirSync(join(figures, id)).filter((f) => f.endsWith('.json'))) {
      const hashes = JSON.parse(readFileSync(join(figures, id, file), 'utf8')).hashes;
      const png = join(figures, id, hashes.name + '.png');
      cpSync(png, join(expected, id, hashes.name + '.png'));
      if (!forced && id === 'fig6') {
        forced = hashes.name;
        const bytes = readFileSync(png);
        writeFileSync(join(expected, id, hashes.name + '.png'), squarePng(bytes.readUInt32BE(16), bytes.readUInt32BE(20)));
        hashes.pixels = '0'.repeat(64);
      }
      pictures.push(hashes);
    }
    writeFileSync(join(expected, id, 'expected.json'), JSON.stringify({ version, figure: id, made_by: 'test', pictures }));
  }
  execFileSync(binary('twofold'), ['report', '--figures', figures, '--expected', expected]);
  return { page: join(figures, 'index.html'), forced };
}

// ---------------------------------------------------------------- the browser, over a pipe

class Browser {
  constructor(name, profile) {
    const flags = ['--headless', '--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage', '--no-first-run', '--hide-scrollbars'];
    this.child = spawn(name, [...flags, '--remote-debugging-pipe', `--user-data-dir=${profile}`, 'about:blank'], {
      stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'],
    });
    this.next = 1;
    this.waiting = new Map();
    this.listeners = [];
    let rest = Buffer.alloc(0);
    this.child.stdio[4].on('data', (data) => {
      rest = Buffer.concat([rest, data]);
      for (let end = rest.indexOf(0); end >= 0; end = rest.indexOf(0)) {
        this.receive(JSON.parse(rest.subarray(0, end).toString('utf8')));
        rest = rest.subarray(end + 1);
      }
    });
    const ended = () => this.waiting.forEach(({ reject }) => reject(new Error('the browser ended')));
    this.child.on('exit', ended);
    this.child.on('error', ended);
    this.child.stdio[3].on('error', ended);
  }

  receive(message) {
    const waiting = this.waiting.get(message.id);
    if (waiting) {
      this.waiting.delete(message.id);
      if (message.error) waiting.reject(new Error(JSON.stringify(message.error)));
      else waiting.resolve(message.result);
    } else {
      this.listeners.forEach((listener) => listener(message));
    }
  }

  send(method, params = {}) {
    const id = this.next++;
    const message = { id, method, params, sessionId: this.session };
    return new Promise((resolve, reject) => {
      const late = setTimeout(() => reject(new Error(`${method}: no answer within 60 s`)), 60000);
      const settle = (f) => (value) => (clearTimeout(late), f(value));
      this.waiting.set(id, { resolve: settle(resolve), reject: settle(reject) });
      this.child.stdio[3].write(JSON.stringify(message) + '\0');
    });
  }

  async open() {
    const { targetId } = await this.send('Target.createTarget', { url: 'about:blank' });
    this.session = (await this.send('Target.attachToTarget', { targetId, flatten: true })).sessionId;
    for (const domain of ['Page', 'Runtime', 'Log', 'Network']) await this.send(`${domain}.enable`);
  }

  async load(url) {
    const loaded = new Promise((resolve) => {
      const listener = (m) => {
        if (m.method !== 'Page.loadEventFired') return;
        this.listeners.splice(this.listeners.indexOf(listener), 1);
        resolve();
      };
      this.listeners.push(listener);
    });
    await this.send('Page.navigate', { url });
    await loaded;
  }

  async run(f, ...values) {
    const expression = `(${f})(...${JSON.stringify(values)})`;
    const { result, exceptionDetails } = await this.send('Runtime.evaluate', { expression, returnByValue: true, awaitPromise: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  }

  async press(key, code, text) {
    const base = { key, code: key === ' ' ? 'Space' : key, windowsVirtualKeyCode: code };
    await this.send('Input.dispatchKeyEvent', { type: 'keyDown', ...base, ...(text ? { text } : {}) });
    await this.send('Input.dispatchKeyEvent', { type: 'keyUp', ...base });
  }

  size(width, height, mobile = false) {
    return this.send('Emulation.setDeviceMetricsOverride', { width, height, deviceScaleFactor: 1, mobile });
  }

  scheme(value) {
    return this.send('Emulation.setEmulatedMedia', { features: [{ name: 'prefers-color-scheme', value }] });
  }

  async shot(name, full = false) {
    if (!shots) return;
    mkdirSync(shots, { recursive: true });
    const { data } = await this.send('Page.captureScreenshot', { format: 'png', captureBeyondViewport: full });
    writeFileSync(join(shots, name), Buffer.from(data, 'base64'));
  }

  async close() {
    const gone = new Promise((resolve) => this.child.on('exit', resolve));
    this.send('Browser.close').catch(() => {});
    await gone;
  }
}

// ---------------------------------------------------------------- what is looked at, inside the page

// Texts whose contrast with what is behind them is below `least`; a colour that is not opaque counts as a failure.
function faintTexts(least) {
  const parse = (c) => {
    const m = c.match(/rgba?\(([^)]+)\)/);
    const v = m ? m[1].split(/[ ,/]+/).map(Number) : [0, 0, 0, 0];
    return v.length < 4 ? [...v, 1] : v;
  };
  const light = ([r, g, b]) => {
    const [x, y, z] = [r, g, b].map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * x + 0.7152 * y + 0.0722 * z;
  };
  const behind = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const c = parse(getComputedStyle(e).backgroundColor);
      if (c[3] === 1) return c;
    }
    return [255, 255, 255, 1];
  };
  const faint = [];
  let seen = 0;
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || ['SCRIPT', 'STYLE'].includes(element.tagName)) continue;
    seen++;
    const colour = parse(getComputedStyle(element).color);
    const [a, b] = [light(colour), light(behind(element))].sort((p, q) => q - p);
    const ratio = (a + 0.05) / (b + 0.05);
    if (colour[3] !== 1 || ratio < least) faint.push(`${ratio.toFixed(2)} ${walker.currentNode.data.trim().slice(0, 40)}`);
  }
  return { seen, faint };
}

function structure() {
  const ids = [...document.querySelectorAll('[id]')].map((e) => e.id);
  const levels = [...document.querySelectorAll('h1,h2,h3,h4,h5,h6')].map((h) => Number(h.tagName[1]));
  const targets = [...document.querySelectorAll('a[href^="#"]')].map((a) => decodeURIComponent(a.getAttribute('href').slice(1)));
  return {
    repeatedIds: ids.filter((id, i) => ids.indexOf(id) !== i),
    skippedLevels: levels.filter((level, i) => i > 0 && level > levels[i - 1] + 1),
    firstLevel: levels[0],
    deadLinks: targets.filter((id) => !document.getElementById(id)),
    headsWithoutScope: document.querySelectorAll('th:not([scope])').length,
    tablesWithoutCaption: [...document.querySelectorAll('table')].filter((t) => !t.caption).length,
    unlabelled: [...document.querySelectorAll('[aria-labelledby]')].filter((e) => !document.getElementById(e.getAttribute('aria-labelledby'))).length,
    landmarks: ['header', 'main', 'footer', 'nav'].filter((n) => !document.querySelector(n)),
    language: document.documentElement.lang,
  };
}

function images() {
  return Promise.all([...document.images].map((i) => i.decode().catch(() => {}))).then(() =>
    [...document.images].map((i) => ({ alt: i.alt, width: i.naturalWidth })));
}

function focusedHead() {
  const head = document.activeElement.closest?.('#all-verdicts th');
  return head ? { name: head.textContent, sort: head.getAttribute('aria-sort'), index: head.cellIndex } : null;
}

function column(index) {
  return [...document.querySelectorAll('#all-verdicts tbody tr')].map((r) => r.cells[index].textContent.trim());
}

const overflow = () => document.documentElement.scrollWidth - window.innerWidth;
const openAll = () => document.querySelectorAll('details').forEach((d) => (d.open = true));

// ---------------------------------------------------------------- the test

let failures = 0;
function check(what, good, detail = '') {
  console.log(`${good ? 'ok  ' : 'FAIL'} ${what}${good || !detail ? '' : `: ${detail}`}`);
  if (!good) failures++;
}
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

async function test(browser, { page, forced }) {
  const complaints = [];
  const requests = [];
  browser.listeners.push((m) => {
    if (m.method === 'Runtime.exceptionThrown') complaints.push(m.params.exceptionDetails.text);
    if (m.method === 'Runtime.consoleAPICalled' && ['error', 'warning', 'assert'].includes(m.params.type)) complaints.push(m.params.type);
    if (m.method === 'Log.entryAdded' && ['error', 'warning'].includes(m.params.entry.level)) complaints.push(m.params.entry.text);
    if (m.method === 'Network.requestWillBeSent') requests.push(m.params.request.url);
  });
  const url = pathToFileURL(page).href;
  await browser.size(1280, 900);
  await browser.scheme('light');
  await browser.load(url);

  check('the page has a title', (await browser.run(() => document.title)).includes('Jeffrey'));
  const pictures = await browser.run(images);
  check('there are pictures', pictures.length >= 5, `${pictures.length}`);
  check('every picture is there', pictures.every((i) => i.width > 0));
  check('every picture has a text', pictures.every((i) => i.alt.trim().length > 10));
  const s = await browser.run(structure);
  check('identifiers are unique', s.repeatedIds.length === 0, s.repeatedIds.join(' '));
  check('headings are in order', s.firstLevel === 1 && s.skippedLevels.length === 0, JSON.stringify(s.skippedLevels));
  check('links inside the page lead somewhere', s.deadLinks.length === 0, s.deadLinks.join(' '));
  check('tables have captions and scopes', s.headsWithoutScope === 0 && s.tablesWithoutCaption === 0);
  check('labels, landmarks and language', s.unlabelled === 0 && s.landmarks.length === 0 && s.language === 'en', JSON.stringify(s));

  const triptych = await browser.run((name) => {
    const box = document.querySelector(`[data-triptych="${name}"]`);
    const words = document.querySelector(`[data-mismatch="${name}"]`)?.textContent ?? '';
    const figures = [...(box?.querySelectorAll('figure') ?? [])];
    return { words, captions: figures.map((f) => f.querySelector('figcaption').textContent), widths: figures.map((f) => f.querySelector('img').naturalWidth) };
  }, forced);
  check('the forced mismatch shows ours, difference, reference', same(triptych.captions, ['Ours', 'Difference', 'Reference']), JSON.stringify(triptych));
  check('its three pictures have one size', triptych.widths.length === 3 && triptych.widths[0] > 0 && new Set(triptych.widths).size === 1);
  check('it names the layer and the numbers', ['pixels', 'changed', 'RMS', 'SSIM'].every((w) => triptych.words.includes(w)), triptych.words);
  check('and it is the only one', (await browser.run(() => document.querySelectorAll('[data-triptych]').length)) === 1);

  // Sorting, by keyboard alone: Tab to the first heading of the table, then Enter and Space.
  for (let i = 0; i < 400 && !(await browser.run(focusedHead)); i++) await browser.press('Tab', 9);
  for (let i = 0; i < 20 && (await browser.run(focusedHead))?.name !== 'The paper'; i++) await browser.press('Tab', 9);
  const head = await browser.run(focusedHead);
  check('Tab reaches a column\'s heading', head?.name === 'The paper' && head.sort === 'none', JSON.stringify(head));
  if (head) {
    const before = await browser.run(column, head.index);
    const sorted = [...before].sort(new Intl.Collator('en', { numeric: true, sensitivity: 'base' }).compare);
    check('the table is not sorted by it yet', !same(before, sorted), 'the test would prove nothing');
    await browser.press('Enter', 13, '\r');
    check('Enter sorts', same(await browser.run(column, head.index), sorted) && (await browser.run(focusedHead)).sort === 'ascending');
    await browser.press(' ', 32, ' ');
    check('Space turns the order round', same(await browser.run(column, head.index), sorted.toReversed?.() ?? [...sorted].reverse()));
    check('and screen readers are told', (await browser.run(() => document.getElementById('sorted').textContent)).includes('descending'));
    const outline = await browser.run(() => getComputedStyle(document.activeElement).outlineStyle);
    check('the focus is visible', outline !== 'none', outline);
  }

  await space(browser);
  if (modules) await rules(browser, page);

  for (const scheme of ['light', 'dark']) {
    await browser.scheme(scheme);
    await browser.run(openAll);
    const { seen, faint } = await browser.run(faintTexts, 4.5);
    check(`contrast of at least 4.5 in ${scheme} mode (${seen} texts)`, seen > 100 && faint.length === 0, faint.slice(0, 5).join(' | '));
    const back = await browser.run(() => getComputedStyle(document.body).backgroundColor);
    const sum = back.match(/\d+/g).slice(0, 3).reduce((t, v) => t + Number(v), 0);
    check(`the paper is ${scheme}`, scheme === 'dark' ? sum < 150 : sum > 700, back);
  }
  for (const width of [320, 360, 414]) {
    await browser.size(width, 740, true);
    const by = await browser.run(overflow);
    check(`no sideways scrolling at ${width} pixels, everything open`, by <= 0, `${by} too wide`);
  }

  await browser.send('Emulation.setScriptExecutionDisabled', { value: true });
  await browser.size(1280, 900);
  await browser.load(url);
  const plain = await browser.run(() => ({
    buttons: document.querySelectorAll('th button').length,
    spaces: document.querySelectorAll('button, canvas').length,
    rows: document.querySelectorAll('#all-verdicts tbody tr').length,
    images: [...document.images].filter((i) => i.naturalWidth > 0).length,
  }));
  check('without script the tables and pictures are there, and no dead buttons', plain.buttons === 0 && plain.spaces === 0 && plain.rows > 0 && plain.images === pictures.length, JSON.stringify(plain));
  await browser.send('Emulation.setScriptExecutionDisabled', { value: false });

  await browser.load(url);
  await browser.scheme('dark');
  await print(browser);
  check('no errors in the console', complaints.length === 0, complaints.join(' | '));
  const foreign = requests.filter((u) => !u.startsWith('data:') && u !== url);
  check('nothing was asked of the network', foreign.length === 0, foreign.join(' '));

  if (shots) {
    await browser.load(url);
    for (const [name, width, height, scheme, mobile] of [['desktop', 1280, 900, 'light', false], ['phone', 390, 844, 'light', true], ['dark', 1280, 900, 'dark', false]]) {
      await browser.size(width, height, mobile);
      await browser.scheme(scheme);
      await browser.shot(`${name}.png`, true);
      await browser.run((n) => document.querySelector(`[data-mismatch="${n}"]`).scrollIntoView({ behavior: 'instant' }), forced);
      await browser.run(openAll);
      await browser.shot(`${name}-mismatch.png`);
      await browser.run(() => window.scrollTo(0, 0));
    }
  }
}

// How much of a canvas is inked, and a digest of it.
async function canvasState() {
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  const canvas = document.querySelector('.space-view canvas');
  const copy = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height }).getContext('2d', { willReadFrequently: true });
  copy.drawImage(canvas, 0, 0);
  const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
  let inked = 0;
  let digest = 0;
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] > 0) inked++;
    digest = (31 * digest + data[i] + 7 * data[i + 1] + 13 * data[i + 3]) | 0;
  }
  return { share: inked / (canvas.width * canvas.height), digest, said: document.querySelector('.space-view .turned').textContent, label: canvas.getAttribute('aria-label') };
}

// Panels in space: opened, turned by button and by arrow key, back to where the picture is.
async function space(browser) {
  const buttons = await browser.run(() => [...document.querySelectorAll('button.open')].map((b) => b.textContent));
  check('every panel of figs 2 and 6 can be turned', buttons.length === 9, buttons.join(', '));
  await browser.run(() => document.querySelector('button.open').click());
  const first = await browser.run(canvasState);
  check('a panel in space is drawn', first.share > 0.02 && first.share < 0.95, JSON.stringify(first));
  await browser.shot('space-light.png');
  await browser.run(() => document.querySelector('.space-view button').focus());
  await browser.press('ArrowRight', 39);
  const turned = await browser.run(canvasState);
  check('an arrow key turns it, and that is said', turned.digest !== first.digest && turned.said !== first.said && turned.label.includes('azimuth'), JSON.stringify(turned));
  await browser.run(() => document.querySelector('.space-view button[aria-label="Tilt up"]').click());
  check('a button tilts it', (await browser.run(canvasState)).digest !== turned.digest);
  await browser.run(() => document.querySelector('.space-view button[aria-label="As in the picture"]').click());
  check('and back as it was', (await browser.run(canvasState)).digest === first.digest);
  await browser.scheme('dark');
  let dark = first;
  for (let i = 0; i < 20 && dark.digest === first.digest; i++) dark = await browser.run(canvasState);
  check('it is drawn anew in dark mode', dark.digest !== first.digest);
  await browser.run(() => document.querySelector('.space-view').scrollIntoView({ behavior: 'instant', block: 'center' }));
  await browser.shot('space-dark.png');
  await browser.scheme('light');
}

// The rules of axe-core in every view, and of html-validate on the page's text.
async function rules(browser, page) {
  const axe = readFileSync(join(modules, 'axe-core', 'axe.min.js'), 'utf8');
  const version = JSON.parse(readFileSync(join(modules, 'axe-core', 'package.json'), 'utf8')).version;
  await browser.send('Runtime.evaluate', { expression: axe });
  const views = [['light', 1280, false], ['dark', 1280, false], ['light', 360, true], ['dark', 360, true]];
  for (const [scheme, width, mobile] of views) {
    await browser.scheme(scheme);
    await browser.size(width, 900, mobile);
    for (const open of [false, true]) {
      await browser.run((all) => document.querySelectorAll('details').forEach((d) => (d.open = all)), open);
      const found = await browser.run(() => axe.run(document, { resultTypes: ['violations'] }).then((r) => ({
        passes: r.passes.length,
        violations: r.violations.map((v) => `${v.id} (${v.nodes.length}: ${v.nodes[0].html.slice(0, 120)})`),
      })));
      check(`axe-core ${version}: no violation, ${scheme}, ${width} pixels, details ${open ? 'open' : 'closed'} (${found.passes} rules hold)`, found.violations.length === 0 && found.passes > 20, found.violations.join(' | '));
    }
  }
  await browser.scheme('light');
  await browser.size(1280, 900);
  const { HtmlValidate, StaticConfigLoader } = await import(pathToFileURL(join(modules, 'html-validate', 'dist', 'esm', 'index.js')).href);
  // The page is also XML: void elements close themselves. Views in space name themselves by more than a heading's words.
  const settings = { extends: ['html-validate:standard', 'html-validate:a11y'], rules: { 'void-style': ['error', { style: 'selfclosing' }] } };
  const report = await new HtmlValidate(new StaticConfigLoader(settings)).validateString(readFileSync(page, 'utf8'));
  const wrong = report.results.flatMap((r) => r.messages.map((m) => `${m.line}:${m.column} ${m.ruleId} ${m.message}`));
  const htmlVersion = JSON.parse(readFileSync(join(modules, 'html-validate', 'package.json'), 'utf8')).version;
  check(`html-validate ${htmlVersion}: the page is valid HTML`, wrong.length === 0, `${wrong.length}: ${wrong.slice(0, 8).join(' | ')}`);
}

// On paper no page ends with a heading. Looked at with pdftotext (Debian: poppler-utils), if it is there.
async function print(browser) {
  const headings = await browser.run(() => [...document.querySelectorAll('h1,h2,h3,h4,summary,caption')].map((h) => h.innerText.replace(/\s+/g, ' ').trim()));
  // Whoever reads in dark mode prints dark on white, too.
  const ink = await browser.run(() => getComputedStyle(document.body).color.match(/\d+/g).slice(0, 3).reduce((sum, v) => sum + Number(v), 0), null);
  await browser.send('Emulation.setEmulatedMedia', { media: 'print', features: [{ name: 'prefers-color-scheme', value: 'dark' }] });
  const printed = await browser.run(() => getComputedStyle(document.body).color.match(/\d+/g).slice(0, 3).reduce((sum, v) => sum + Number(v), 0), null);
  check('print is dark on white, also of a page read in dark mode', ink > 600 && printed < 150, `${ink} ${printed}`);
  await browser.send('Emulation.setEmulatedMedia', { media: '', features: [{ name: 'prefers-color-scheme', value: 'dark' }] });
  const { data } = await browser.send('Page.printToPDF', { preferCSSPageSize: true, paperWidth: 8.27, paperHeight: 11.69 });
  const pdf = Buffer.from(data, 'base64');
  check('the page prints', pdf.length > 100000);
  if (shots) writeFileSync(join(shots, 'print.pdf'), pdf);
  const read = spawnSync('pdftotext', ['-', '-'], { input: pdf, encoding: 'utf8', maxBuffer: 1 << 28 });
  if (read.error) {
    console.log('NOT RUN: headings at the foot of a printed page (no pdftotext)');
    return;
  }
  const pages = read.stdout.split('\f').filter((text) => text.trim());
  const last = pages.slice(0, -1).map((text) => text.trim().split('\n').at(-1).replace(/\s+/g, ' ').trim());
  const alone = last.filter((line) => line.length > 3 && headings.some((h) => h === line || h.endsWith(line) && h.length < 2 * line.length));
  check(`no heading stands alone at the foot of a printed page (${pages.length} pages)`, pages.length > 3 && alone.length === 0, alone.join(' | '));
}

function skip(why) {
  console.log(`browser test SKIPPED: ${why}. Install one (Debian: apt-get install chromium) or set CHROMIUM to its path.`);
  process.exit(process.argv.includes('--require') ? 1 : 0);
}

const found = findBrowser();
if (!found) skip('no Chromium or Chrome found');
console.log(found.version);
const folder = mkdtempSync(join(tmpdir(), 'twofold-browser-'));
const browser = new Browser(found.name, join(folder, 'profile'));
try {
  await browser.open();
} catch (error) {
  // A browser that cannot start (no shared memory, no sandbox) says nothing about the page.
  browser.child.kill('SIGKILL');
  rmSync(folder, { recursive: true, force: true, maxRetries: 5 });
  skip(`the browser found does not start (${error.message})`);
}
try {
  await test(browser, prepare(folder));
} catch (error) {
  check('the test ran to its end', false, error.stack ?? String(error));
} finally {
  await browser.close().catch(() => {});
  rmSync(folder, { recursive: true, force: true, maxRetries: 5 });
}
console.log(failures === 0 ? 'browser test passed' : `browser test: ${failures} failed`);
process.exit(failures === 0 ? 0 : 1);
