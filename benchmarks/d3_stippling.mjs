// Voronoi stippling as the notebook of d3-delaunay does it: each pixel finds its cell from that of the pixel before, and
// points move 1.8 times as far as to the center of mass.
//   node d3_stippling.mjs DENSITY WIDTH HEIGHT POINTS N ITERATIONS OUTPUT
// DENSITY is float32, POINTS and OUTPUT are float64 (x, y). Prints processor seconds.
import fs from "node:fs";
import {Delaunay} from "d3-delaunay";

const [densityPath, width, height, pointsPath, n, iterations, output] = process.argv.slice(2)
  .map((text) => (/^\d+$/.test(text) ? Number(text) : text));
const read = (path, Type) => {
  const bytes = fs.readFileSync(path);
  return new Type(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
};
const density = read(densityPath, Float32Array);
const points = read(pointsPath, Float64Array);
const sums = new Float64Array(2 * n);
const masses = new Float64Array(n);

const start = process.cpuUsage();
const delaunay = new Delaunay(points);
const voronoi = delaunay.voronoi([0, 0, width, height]);
for (let iteration = 0; iteration < iterations; ++iteration) {
  sums.fill(0);
  masses.fill(0);
  for (let y = 0, cell = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x) {
      const mass = density[y * width + x];
      cell = delaunay.find(x + 0.5, y + 0.5, cell);
      masses[cell] += mass;
      sums[2 * cell] += mass * (x + 0.5);
      sums[2 * cell + 1] += mass * (y + 0.5);
    }
  }
  for (let i = 0; i < 2 * n; ++i) {
    const mass = masses[i >> 1];
    if (mass) points[i] += (sums[i] / mass - points[i]) * 1.8;
  }
  voronoi.update();
}
const used = process.cpuUsage(start);
console.log((used.user + used.system) / 1e6);
fs.writeFileSync(output, Buffer.from(points.buffer));
