// Plays a case of `pidemu vectors` to a controller of your own, here my_controller.js: node play.js vectors.json linear
const fs = require("fs"), path = require("path"), [file, name] = process.argv.slice(2);
const control = require(path.resolve("my_controller.js"));
const number = (x) => (typeof x === "number" ? x : { inf: Infinity, "-inf": -Infinity }[x] ?? NaN);
const { inputs, outputs } = JSON.parse(fs.readFileSync(file, "utf8")).cases.find((one) => one.name === name);
const state = control.initial();
outputs.map(number).forEach((expected, n) => {
  const output = control.scan(state, ...["sp", "pv", "auto", "manual"].map((signal) => number(inputs[signal][n])));
  if (output !== expected) throw new Error(`${name}: scan ${n}: ${output} instead of ${expected}`);
});
console.log(`${name}: equal`);
