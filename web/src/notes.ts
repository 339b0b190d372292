// The line over the picture: what holds, and for a moment what has just been done.
export class Notes {
  private holding = "";
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly show: (words: string) => void) {}

  /** What holds from now on; empty: nothing is to be said. */
  state(words: string): void {
    clearTimeout(this.timer);
    this.show((this.holding = words));
  }

  /** For a moment, instead of what holds. */
  tell(words: string, for_ms = 2500): void {
    clearTimeout(this.timer);
    this.show(words);
    this.timer = setTimeout(() => this.show(this.holding), for_ms);
  }
}
