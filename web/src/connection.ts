// The WebSocket to the server of a live session, opened again whenever it is lost.
import type { ToldExercise } from "./exercise";

export interface Role {
  steers: boolean;
  browsers: number;
  exercise?: ToldExercise; // of a server
}

export interface LinkListener {
  told(message: ArrayBuffer): void;
  has_role(role: Role): void;
}

/** To what runs the session, a server or a worker. */
export interface SessionLink {
  send(message: object): void;
}

const kSoon_ms = 500, kLate_ms = 8000; // from a loss to the next attempt

export class Connection implements SessionLink {
  private socket: WebSocket | null = null;
  private wait_ms = kSoon_ms;

  constructor(private readonly address: string, private readonly listener: LinkListener & { lost(): void }) {
    this.open();
  }

  /** Nothing where there is no connection. */
  send(message: object): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  private open(): void {
    const socket = (this.socket = new WebSocket(this.address));
    socket.binaryType = "arraybuffer";
    socket.addEventListener("open", () => (this.wait_ms = kSoon_ms));
    socket.addEventListener("message", ({ data }) => {
      if (typeof data === "string") this.listener.has_role(JSON.parse(data) as Role);
      else this.listener.told(data as ArrayBuffer);
    });
    socket.addEventListener("close", () => {
      this.listener.lost();
      setTimeout(() => this.open(), this.wait_ms);
      this.wait_ms = Math.min(kLate_ms, 2 * this.wait_ms);
    });
  }
}
