/** `report-left-renal-artery-20261129-212605.json`: files of several runs, and of several people, lie side by side. */
export function name_of_file(kind: string, title: string, ending: string, at = new Date()): string {
  const digits = (value: number) => String(value).padStart(2, "0"), words = title.toLowerCase().match(/[\p{L}\p{N}]+/gu) ?? [];
  const day = `${at.getFullYear()}${digits(at.getMonth() + 1)}${digits(at.getDate())}`, time = [at.getHours(), at.getMinutes(), at.getSeconds()].map(digits).join("");
  return `${[kind, ...words, day, time].join("-")}.${ending}`;
}

/** Hands a file to whoever reads the page, as a download. */
export function save_file(file: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(file);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
