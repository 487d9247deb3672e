/** How many times as long as they are arrows are drawn, where that is fitted to the view. */

const WANTED_PX = 30;
const FACTORS = [1, 2, 5, 10, 20, 50, 100, 200, 500];

/** The factor that makes the longer residuals about a finger's breadth long; 1 without any. */
export function fittedFactor(residualsM: readonly number[], pixelM: number): number {
  const sorted = [...residualsM].sort((one, other) => one - other);
  const long = sorted[Math.floor(sorted.length * 0.9)] ?? 0;
  return FACTORS.findLast((factor) => long * factor <= WANTED_PX * pixelM) ?? 1;
}
