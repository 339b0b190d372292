// Curves over the last seconds, each on its own scale, with their newest values in words.

export interface StripCurve {
  values: readonly number[]; // at even times
  colour: string; // of the style
  low: number;
  high: number;
  words: string;
}

/** The first one's words are on the left, those of the others on the right; a mark stands at the present. */
export function draw_strip(canvas: HTMLCanvasElement, curves: readonly StripCurve[], now: number): void {
  const scale = devicePixelRatio, width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
  if (width === 0 || height === 0) return;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d")!, style = getComputedStyle(canvas);
  context.clearRect(0, 0, width, height);
  const last = Math.max(1, (curves[0]?.values.length ?? 0) - 1), x_of = (i: number) => (i / last) * (width - 1);
  context.font = `${11 * scale}px system-ui, sans-serif`;
  curves.forEach(({ values, colour, low, high, words }, k) => {
    const y_of = (value: number) => height - 3 * scale - ((value - low) / (high - low)) * (height - 20 * scale);
    context.strokeStyle = context.fillStyle = style.getPropertyValue(colour);
    context.lineWidth = 1.5 * scale;
    context.beginPath();
    values.forEach((value, i) => context.lineTo(x_of(i), y_of(value)));
    context.stroke();
    context.textAlign = k === 0 ? "left" : "right";
    context.fillText(words, k === 0 ? 4 * scale : width - 4 * scale, 12 * scale);
  });
  context.fillStyle = style.color;
  context.fillRect(x_of(now) - 0.5 * scale, 0, scale, height);
}
