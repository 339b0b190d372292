/** With so many decimals, and zero without a sign. */
export const fixed = (x: number, digits: number) => (Number(x.toFixed(digits)) + 0).toFixed(digits);
