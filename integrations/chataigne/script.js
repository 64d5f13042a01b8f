// Corybant in Chataigne. In: commands of module.json, OSC messages of the show. Out: OSC messages, values of the module.
// Chataigne's engine knows only a part of JavaScript: no toLowerCase, no let, no arrow functions.

var UPPER = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";
var LOWER = "abcdefghijklmnopqrstuvwxyz";
var KEPT = "abcdefghijklmnopqrstuvwxyz0123456789_-";

function init() {
  local.send("/sync");
}

// The label in OSC addresses: lower case, _ in place of other characters.
function nameOf(label) {
  var name = "";
  for (var i = 0; i < label.length; i++) {
    var c = label.charAt(i);
    var upper = UPPER.indexOf(c);
    if (upper >= 0) c = LOWER.charAt(upper);
    name += KEPT.indexOf(c) >= 0 ? c : "_";
  }
  return name;
}

function number(on) {
  return on ? 1 : 0;
}

function dance(label, launch, on) {
  local.send("/cue/" + nameOf(label) + launch, number(on));
}

function cancel(label) {
  local.send("/cue/" + nameOf(label) + "/cancel");
}

function panic() {
  local.send("/panic");
}

function release() {
  local.send("/release");
}

function hold(on) {
  local.send("/hold", number(on));
}

function intensity(value) {
  local.send("/intensity", value);
}

function intensityRelease() {
  local.send("/intensity/release");
}

function performer(value) {
  local.send("/performer", value);
}

function follow() {
  local.send("/follow");
}

function offset(milliseconds) {
  local.send("/offset", milliseconds);
}

function tap() {
  local.send("/tempo/tap");
}

function half() {
  local.send("/tempo/half");
}

function doubleTempo() {
  local.send("/tempo/double");
}

function downbeat() {
  local.send("/tempo/downbeat");
}

function nudge(milliseconds) {
  local.send("/tempo/nudge", milliseconds);
}

function bpm(value) {
  local.send("/tempo/bpm", value);
}

function source(name) {
  local.send("/tempo/source", name);
}

function freeze(on) {
  local.send("/tempo/freeze", number(on));
}

function timecode(on) {
  local.send("/timecode/engage", number(on));
}

function sync() {
  local.send("/sync");
}

function oscEvent(address, args) {
  if (args.length === 0) return;
  var value = args[0];
  if (address === "/tempo/bpm") local.values.tempo.set(value);
  else if (address === "/beat/phase") local.values.phase.set(value);
  else if (address === "/beat/confidence") local.values.confidence.set(value);
  else if (address === "/state/source") local.values.source.set(value);
  else if (address === "/state/clip") local.values.clip.set(value);
  else if (address === "/state/next") local.values.next.set(value);
  else if (address === "/state/cue") local.values.cue.set(value);
  else if (address === "/state/queue") local.values.queue.set(value);
  else if (address === "/hold") local.values.hold.set(value > 0);
  else if (address === "/tempo/freeze") local.values.frozen.set(value > 0);
  else if (address === "/meter/in") local.values.level.set(value);
}
