// A canvas that is as sharp as the screen, and knows the page's colours.

let colours = {};
export const colour = (name) => colours[name];

function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ['card', 'text', 'dim', 'line', 'grid', 'front', 'rear', 'band', 'ink']) {
    colours[name] = style.getPropertyValue(`--${name}`).trim();
  }
}
readColours();

// Calls `redraw` when colours or sizes have changed.
export function onLookChange(redraw) {
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { readColours(); redraw(); });
  const sizes = new ResizeObserver(redraw);
  for (const canvas of document.querySelectorAll('canvas')) sizes.observe(canvas);
}

// Clears a canvas and returns its context, in CSS pixels, with its width and height.
export function begin(id) {
  const canvas = document.getElementById(id);
  const ratio = devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = `12px ${getComputedStyle(document.body).fontFamily}`;
  context.lineJoin = context.lineCap = 'round';
  return { canvas, context, width, height };
}
