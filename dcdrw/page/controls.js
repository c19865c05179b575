// Sliders and buttons: they ask, and show what the nodes say that they have done.

import { tickStep } from './charts.js';

const element = (id) => document.getElementById(id);
const HOLD_MS = 1500;  // after a touch, a slider shows what was asked for, until the node has answered
const SEND_MS = 80;
const NOTICE_MS = 10000;
const BEAT_MS = 60;  // the heartbeat lasts as long as this page is in sight and connected
const CONFIRM_MS = 4000;

let send = () => false;
let board = null, fading = null, beating = null, asked = null;
const sliders = new Map();

export function setUpControls(sender) {
  send = sender;
  for (const id of ['controls', 'more-controls']) {
    element(id).addEventListener('submit', (event) => event.preventDefault());
  }
  element('reset').addEventListener('click', () => send({ do: 'reset' }));
  element('pause').addEventListener('click', () => send({ do: 'pause', value: !board.paused }));
  element('record').addEventListener('click', () => send({ do: 'record', value: !board.recording }));
  element('enable').addEventListener('click', () => (beating ? endBeat() : asked ? beginBeat() : ask()));
  element('stop').addEventListener('click', () => {
    endBeat();
    send({ do: 'stop' });
  });
  document.addEventListener('visibilitychange', () => document.hidden && beating && endBeat());
  showControls(null);
}

// The first touch asks, the second enables; a touch later ends it.
function ask() {
  asked = setTimeout(() => { asked = null; showActing(); }, CONFIRM_MS);
  showActing();
}

function beginBeat() {
  clearTimeout(asked);
  asked = null;
  beating = setInterval(() => send({ do: 'enable', value: true }), BEAT_MS);
  showActing();
}

function endBeat() {
  clearInterval(beating);
  beating = null;
  send({ do: 'enable', value: false });
  showActing();
}

function showActing() {
  const acts = board && board.synchronizer;
  const person = board && board.person;
  element('acting').hidden = !acts;
  element('acts').textContent = acts ? acts.replace('_', ' ') : '–';
  element('enable').hidden = element('stop').hidden = !(board && board.may_enable);
  press('enable', Boolean(beating), 'Release', asked ? 'Really let it push?' : 'Enable');
  element('person').textContent = person ? `· on the person at most ${person.peak} N, ${person.rms} N rms` : '';
}

export function showControls(news) {
  board = news;
  const simulated = Boolean(board && board.simulated), recorder = Boolean(board && board.recorder);
  for (const control of board ? board.controls : []) {
    if (!sliders.has(control.name)) sliders.set(control.name, new Slider(control));
    sliders.get(control.name).show(control, simulated);
  }
  element('reset').disabled = element('pause').disabled = !simulated;
  element('record').disabled = !recorder;
  press('pause', simulated && board.paused, 'Go on', 'Pause');
  press('record', recorder && board.recording, '■ Stop recording', '● Record');
  if (beating && (!board || board.unknown || !board.synchronizer)) endBeat();  // nobody is there to hear it
  showActing();
  const hints = [];
  if (board && !board.unknown && !simulated) hints.push('No simulator runs here: sliders, reset and pause act on the simulated rig alone.');
  if (board && !board.unknown && !recorder) hints.push('No recorder runs here: start the node recorder to record.');
  const text = hints.join(' ');
  if (element('hint').textContent !== text) element('hint').textContent = text;
}

export function showNotices(notices) {
  const { text, ok } = notices.at(-1);
  element('notice').className = ok ? 'good' : 'bad';
  element('notice').textContent = text;
  clearTimeout(fading);
  fading = setTimeout(() => { element('notice').textContent = ''; }, NOTICE_MS);
}

function press(id, pressed, active, idle) {
  element(id).setAttribute('aria-pressed', String(pressed));
  const text = pressed ? active : idle;
  if (element(id).textContent !== text) element(id).textContent = text;
}

class Slider {
  constructor({ name, doc, unit, low, high, top, scale, more }) {
    Object.assign(this, { name, scale, touched: -Infinity, timer: null });
    const label = document.createElement('label');
    label.innerHTML = '<span><b></b> <span></span></span><span class="entry"><input type="number" step="any">'
      + '<span class="unit"></span></span><input type="range">';
    label.querySelector('b').textContent = { slope: 'γ' }[name] || name;
    label.querySelector('span span').textContent = doc.replace(/ γ| of the coupler|, positive.*/g, '');
    label.querySelector('.unit').textContent = unit;
    [this.field, this.range] = label.querySelectorAll('input');
    this.field.id = `${name}-field`;
    this.range.id = `${name}-range`;
    this.field.setAttribute('aria-label', `${doc}, ${unit}`);
    this.range.setAttribute('aria-label', `${doc}, ${unit}`);
    if (low !== null) this.field.min = Number((low * scale).toFixed(3));
    if (high !== null) this.field.max = Number((high * scale).toFixed(3));
    this.range.min = Math.max(0, low * scale);
    this.range.step = tickStep(top * scale, 200);
    this.range.max = Math.ceil(top * scale / this.range.step) * this.range.step;
    this.range.addEventListener('input', () => this.ask(this.range.valueAsNumber, this.field));
    this.field.addEventListener('change', () => {
      if (this.field.reportValidity() && Number.isFinite(this.field.valueAsNumber)) {
        this.ask(this.field.valueAsNumber, this.range);
      }
    });
    element(more ? 'more-controls' : 'controls').append(label);
  }

  // Sends the last value asked for, at most every SEND_MS.
  ask(value, other) {
    this.touched = performance.now();
    this.wanted = value;
    this.spread(value, other);
    this.timer ??= setTimeout(() => {
      this.timer = null;
      send({ do: 'set', name: this.name, value: this.wanted / this.scale });
    }, SEND_MS);
  }

  // What the node has: unless somebody is about to change it.
  show({ value }, simulated) {
    this.field.disabled = this.range.disabled = !simulated;
    if (performance.now() - this.touched < HOLD_MS || document.activeElement === this.field) return;
    this.spread(value * this.scale, this.range, this.field);
  }

  spread(value, ...inputs) {
    while (value > Number(this.range.max)) this.range.max = 2 * Number(this.range.max);
    for (const input of inputs) input.value = Number(value.toPrecision(5));
  }
}
