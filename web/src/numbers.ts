// Whole numbers as the program packs them (viewer/xraycast/export/packed_numbers.hpp).

/** Signed numbers: seven bits a byte, the lowest first, the sign in the lowest bit. */
export class Numbers {
  private at = 0;
  constructor(private readonly bytes: Uint8Array) {}

  next(): number {
    let value = 0, times = 1, byte: number;
    do {
      byte = this.bytes[this.at++] ?? 0;
      value += (byte & 127) * times;
      times *= 128;
    } while (byte & 128);
    return value % 2 === 0 ? value / 2 : -(value + 1) / 2;
  }
}
