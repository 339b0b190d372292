// Values over the time of a run, a line an instrument.

const kHeight = 110, kColours = ["--force", "--torque", "--accent"];

export interface SeriesLine {
  name: string;
  values: readonly number[];
}

export class SeriesChart {
  private readonly canvas = document.createElement("canvas");

  constructor(parent: HTMLElement, private readonly title: string, private readonly digits: number) {
    this.canvas.setAttribute("role", "img");
    parent.append(this.canvas);
  }

  draw(time_s: readonly number[], lines: readonly SeriesLine[]): void {
    const { canvas } = this, scale = devicePixelRatio, width = canvas.clientWidth, style = getComputedStyle(canvas), end_s = time_s[time_s.length - 1] ?? 0;
    const values = lines.flatMap(({ values }) => values), low = values.reduce((a, b) => Math.min(a, b), 0), high = values.reduce((a, b) => Math.max(a, b), low + 1e-9);
    Object.assign(canvas, { width: Math.round(width * scale), height: Math.round(kHeight * scale) });
    canvas.setAttribute("aria-label", `${this.title}: ${lines.map(({ name, values }) => `${name} up to ${values.reduce((a, b) => Math.max(a, b), 0).toFixed(this.digits)}`).join(", ")}`);
    const context = canvas.getContext("2d")!, left = 44, right = 8, top = 20, bottom = 18;
    context.scale(scale, scale);
    context.font = "11px system-ui, sans-serif";
    const x = (at_s: number) => left + ((width - left - right) * at_s) / Math.max(end_s, 1e-9), y = (value: number) => kHeight - bottom - ((kHeight - top - bottom) * (value - low)) / (high - low);
    const text = (words: string, at_x: number, at_y: number, colour: string, align: CanvasTextAlign) => {
      context.fillStyle = style.getPropertyValue(colour);
      context.textAlign = align;
      context.fillText(words, at_x, at_y);
    };
    context.strokeStyle = style.getPropertyValue("--line");
    for (const value of [low, high]) {
      context.beginPath();
      context.moveTo(left, y(value));
      context.lineTo(width - right, y(value));
      context.stroke();
      text(value.toFixed(this.digits), left - 4, y(value) + 4, "--faint", "right");
    }
    text(this.title, left, 12, "--ink", "left");
    text("0 s", left, kHeight - 4, "--faint", "left");
    text(`${end_s.toFixed(0)} s`, width - right, kHeight - 4, "--faint", "right");
    let name_right = width - right;
    lines.forEach(({ name, values }, d) => {
      const colour = kColours[d % kColours.length]!;
      text(name, name_right, top + 12, colour, "right");
      name_right -= context.measureText(name).width + 12;
      context.strokeStyle = style.getPropertyValue(colour);
      context.lineWidth = 1.5;
      context.beginPath();
      values.forEach((value, i) => context.lineTo(x(time_s[i]!), y(value)));
      context.stroke();
    });
  }
}
