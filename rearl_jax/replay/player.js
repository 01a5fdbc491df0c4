"use strict";
(() => {
  const data = JSON.parse(document.getElementById("replay-data").textContent);
  const player = document.querySelector(".player");
  const part = name => player.querySelector(`[data-${name}]`);
  const ui = Object.fromEntries(
    ["play", "scrub", "clock", "scene", "speed", "view", "state", "sim", "real", "chart", "sim-note", "real-note"].map(n => [n, part(n)]));
  const last = data.seconds - 1;
  const LANE = data.laneWidth / 100;
  const WIDTH = 2;            // width at which every vehicle is drawn, metres; recordings hold no widths
  const TRUCK = 7;            // length from which a vehicle is drawn with a cab, metres
  const MARKS = ["left", "keep", "right", "faster", "slower"];
  let scene, time = 0, playing = false, before = null, colours;

  // Differences in whole centimetres become positions in metres.
  const summed = steps => { let at = 0; return steps.map(step => (at += step) / 100); };
  for (const item of data.scenes) for (const side of [item.sim, item.real])
    for (const vehicle of side.vehicles) { vehicle.x = summed(vehicle.x); vehicle.y = summed(vehicle.y); vehicle.l /= 100; }
  for (const item of data.scenes) {
    item.told = Array.from({ length: data.seconds }, () => new Map());
    for (const [second, vehicle, action] of item.sim.asked) item.told[second].set(vehicle, action);
    item.reach = Math.max(spread(item.sim), spread(item.real)) + 30;
  }

  // Vehicles present at a time, between two frames in a straight line.
  function present(side, at) {
    const frame = Math.min(Math.floor(at), last), share = at - frame, found = [];
    side.vehicles.forEach((vehicle, index) => {
      const i = frame - vehicle.t;
      if (i < 0 || i >= vehicle.x.length) return;
      const j = Math.min(i + 1, vehicle.x.length - 1);
      found.push({
        index, length: vehicle.l, replayed: vehicle.r === 1,
        x: vehicle.x[i] + share * (vehicle.x[j] - vehicle.x[i]), y: vehicle.y[i] + share * (vehicle.y[j] - vehicle.y[i]),
      });
    });
    return found;
  }
  // The longest stretch that vehicles take up at any time.
  function spread(side) {
    let widest = 0;
    for (let frame = 0; frame <= last; frame++) {
      const x = present(side, frame).map(one => one.x);
      if (x.length) widest = Math.max(widest, Math.max(...x) - Math.min(...x));
    }
    return widest;
  }

  function canvasOf(canvas, height) {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
      canvas.style.height = `${height}px`;
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "11px system-ui, sans-serif";
    return [pen, width];
  }

  function drawRoad(canvas, side, lanes, told) {
    const close = ui.view.value === "close";
    const reach = !close ? scene.reach : canvas.clientWidth < 600 ? 100 : 200;
    const scale = canvas.clientWidth / reach;                    // pixels per metre along the road
    const across = close ? scale : Math.max(scale, 5);            // and across it
    // In the whole stretch a car to scale would be a dot.
    const enlarged = close ? 1 : Math.max(1, 3 / scale);
    const top = 26, height = top + lanes * LANE * across + 20;
    const [pen, width] = canvasOf(canvas, height);
    const vehicles = present(side, time);
    const x = vehicles.map(one => one.x).sort((a, b) => a - b);
    const middle = !x.length ? 0 : close ? x[Math.floor(x.length / 2)] : (x[0] + x[x.length - 1]) / 2;
    const left = middle - reach / 2, px = metres => (metres - left) * scale;
    const py = y => top + (y + LANE / 2) * across;

    pen.fillStyle = colours.road;
    pen.fillRect(0, top, width, lanes * LANE * across);
    pen.strokeStyle = colours.lane;
    for (let lane = 0; lane <= lanes; lane++) {
      const edge = lane === 0 || lane === lanes;
      pen.lineWidth = edge ? 1.5 : 1;
      pen.setLineDash(edge ? [] : [3 * scale + 4, 6 * scale + 6]);
      pen.lineDashOffset = edge ? 0 : left * scale;
      pen.beginPath(); pen.moveTo(0, top + lane * LANE * across); pen.lineTo(width, top + lane * LANE * across); pen.stroke();
    }
    pen.setLineDash([]);
    const grid = close ? 50 : 100;
    pen.fillStyle = colours.soft; pen.textAlign = "center";
    for (let at = Math.ceil(left / grid) * grid; at < left + reach; at += grid) {
      pen.fillRect(px(at), height - 20, 1, 5);
      const label = `${at} m`, room = pen.measureText(label).width / 2 + 2;
      if (px(at) > room && px(at) < width - room) pen.fillText(label, px(at), height - 4);
    }
    let behind = 0, ahead = 0;
    for (const one of vehicles) {
      const middleX = px(one.x), middleY = py(one.y), length = one.length * scale * enlarged, broad = WIDTH * (close ? across : scale * enlarged);
      if (middleX < -length) { behind++; continue; }
      if (middleX > width + length) { ahead++; continue; }
      const action = told.get(one.index);
      const crashed = side.crash && side.crash[one.index] >= 0 && time >= side.crash[one.index];
      // Outlines tell replayed vehicles from simulated ones without colour too.
      pen.fillStyle = action !== undefined ? colours.asked : one.replayed ? colours.road : colours.car;
      pen.strokeStyle = action !== undefined ? colours.askedEdge : colours.edge;
      pen.lineWidth = action !== undefined ? 2 : 1;
      pen.beginPath(); pen.rect(middleX - length / 2, middleY - broad / 2, length, broad);
      pen.fill(); pen.stroke();
      // The windscreen, or the gap behind the cab: where the front is.
      pen.fillStyle = pen.strokeStyle;
      pen.fillRect(middleX + length / 2 - (one.length > TRUCK ? 2.6 : 1.7) * scale * enlarged, middleY - 0.4 * broad, 0.6 * scale * enlarged, 0.8 * broad);
      if (crashed) {
        pen.strokeStyle = colours.crashed; pen.lineWidth = 2; pen.setLineDash([3, 2]);
        pen.strokeRect(middleX - length / 2 - 3, middleY - broad / 2 - 3, length + 6, broad + 6); pen.setLineDash([]);
      }
      if (action !== undefined) drawMark(pen, MARKS[action], middleX, middleY - broad / 2 - 7);
    }
    pen.fillStyle = colours.soft;
    if (behind) { pen.textAlign = "left"; pen.fillText(`◂ ${behind} behind`, 2, 11); }
    if (ahead) { pen.textAlign = "right"; pen.fillText(`${ahead} ahead ▸`, width - 2, 11); }
  }

  // The decision about a vehicle, as a shape above it that is distinguishable without colour.
  function drawMark(pen, name, x, y) {
    const r = 4.5, corners = {
      left: [[0, -r], [r, r], [-r, r]], right: [[0, r], [r, -r], [-r, -r]],
      faster: [[r, 0], [-r, r], [-r, -r]], slower: [[-r, 0], [r, r], [r, -r]],
    }[name];
    pen.fillStyle = colours.asked; pen.strokeStyle = colours.askedEdge; pen.lineWidth = 1;
    pen.beginPath();
    if (corners) { corners.forEach(([dx, dy]) => pen.lineTo(x + dx, y + dy)); pen.closePath(); pen.fill(); pen.stroke(); }
    else if (name === "keep") { pen.arc(x, y, r - 1, 0, 7); pen.fill(); pen.stroke(); }
    else { pen.lineWidth = 2; pen.moveTo(x - 3, y - 3); pen.lineTo(x + 3, y + 3); pen.moveTo(x + 3, y - 3); pen.lineTo(x - 3, y + 3); pen.stroke(); }
  }

  function drawChart() {
    const height = 120, [pen, width] = canvasOf(ui.chart, height);
    const left = 34, right = 6, top = 18, bottom = 18, real = scene.real.scaled;
    const most = Math.max(1, ...scene.sim.speed, ...real) * 1.05;
    const px = second => left + second / Math.max(last, 1) * (width - left - right);
    const py = speed => height - bottom - speed / most * (height - top - bottom);
    const asked = Math.max(1, ...scene.told.map(one => one.size));
    pen.fillStyle = colours.asked; pen.globalAlpha = 0.55;
    scene.told.forEach((one, second) => {
      const tall = one.size / asked * 0.45 * (height - top - bottom);
      pen.fillRect(px(second), height - bottom - tall, Math.max((width - left - right) / data.seconds - 1, 1), tall);
    });
    pen.globalAlpha = 1;
    pen.strokeStyle = colours.lane; pen.lineWidth = 1;
    pen.beginPath(); pen.moveTo(left, top); pen.lineTo(left, height - bottom); pen.lineTo(width - right, height - bottom); pen.stroke();
    pen.fillStyle = colours.soft; pen.textAlign = "right";
    for (let speed = 0; speed < most; speed += most > 20 ? 10 : 5) pen.fillText(String(speed), left - 4, py(speed) + 4);
    pen.textAlign = "left"; pen.fillText("m/s", 2, 10);
    pen.textAlign = "center";
    for (let second = 0; second <= last; second += last > 30 ? 10 : 5) pen.fillText(`${second} s`, Math.min(px(second), width - 14), height - 4);
    for (const [speeds, colour, dash] of [[real, colours.realLine, [5, 4]], [scene.sim.speed, colours.simLine, []]]) {
      pen.strokeStyle = colour; pen.lineWidth = 2; pen.setLineDash(dash); pen.beginPath();
      speeds.forEach((speed, second) => pen.lineTo(px(second), py(speed)));
      pen.stroke();
    }
    pen.setLineDash([]); pen.strokeStyle = colours.ink; pen.lineWidth = 1.5;
    pen.beginPath(); pen.moveTo(px(time), top - 4); pen.lineTo(px(time), height - bottom); pen.stroke();
  }

  function draw() {
    const second = Math.min(Math.floor(time), last), told = scene.told[second];
    drawRoad(ui.sim, scene.sim, data.lanes, told);
    drawRoad(ui.real, scene.real, data.realLanes, new Map());
    drawChart();
    ui.clock.textContent = `${time.toFixed(1)} s`;
    ui.scrub.value = time;
    ui.scrub.setAttribute("aria-valuetext", `${time.toFixed(1)} of ${last} seconds`);
    player.dataset.second = time.toFixed(2);
    const compared = scene.real.scaled[second].toFixed(1);
    const rescaled = compared === scene.real.speed[second].toFixed(1) ? "" : ` (compared as ${compared} m/s)`;
    const crashes = scene.sim.crash.filter(frame => frame >= 0 && frame <= second).length;
    ui.state.textContent = `Second ${second}: mean speed ${scene.sim.speed[second].toFixed(1)} m/s simulated, `
      + `${scene.real.speed[second].toFixed(1)} m/s recorded${rescaled}`
      + (data.decisions ? `; ${told.size} of ${scene.sim.places} vehicles asked` : "")
      + (crashes ? `; ${crashes} crashed so far.` : ".");
  }

  function setPlaying(on) {
    if (on && time >= last) time = 0;
    playing = on; before = null;
    ui.play.textContent = on ? "Pause" : "Play";
    player.dataset.playing = String(on);
    if (on) requestAnimationFrame(step);
  }
  function step(now) {
    if (!playing) return;
    // A page that was hidden does not jump when it comes back.
    if (before !== null) time = Math.min(time + Math.min(now - before, 250) / 1000 * Number(ui.speed.value), last);
    before = now;
    draw();
    if (time >= last) setPlaying(false); else requestAnimationFrame(step);
  }
  function seek(to) { time = Math.min(Math.max(to, 0), last); draw(); }
  function choose(index) {
    scene = data.scenes[index]; time = 0;
    ui["sim-note"].textContent = `run ${scene.run} of scene ${scene.id}, Hellinger distance of its speeds ${scene.h}`;
    ui["real-note"].textContent = `scene ${scene.id}: recording ${scene.recording} from ${scene.start} s`;
    draw();
  }
  function readColours() {
    const style = getComputedStyle(player), of = name => style.getPropertyValue(`--${name}`).trim();
    colours = {
      ink: of("ink"), soft: of("soft"), road: of("road"), lane: of("lane"), car: of("car"), edge: of("edge"), asked: of("asked"),
      askedEdge: of("asked-edge"), crashed: of("crashed"), simLine: of("simline"), realLine: of("realline"),
    };
  }

  data.scenes.forEach((one, index) => ui.scene.add(new Option(`${one.id}, ${one.recording} at ${one.start} s`, index)));
  ui.scrub.max = last;
  ui.play.addEventListener("click", () => setPlaying(!playing));
  ui.scrub.addEventListener("input", () => { setPlaying(false); seek(Number(ui.scrub.value)); });
  ui.scene.addEventListener("change", () => choose(Number(ui.scene.value)));
  ui.view.addEventListener("change", draw);
  player.addEventListener("keydown", event => {
    if (event.target.matches("select, input") || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "ArrowRight") seek(time + 1);
    else if (event.key === "ArrowLeft") seek(time - 1);
    else if (event.key === "Home") seek(0);
    else if (event.key === "End") seek(last);
    else return;
    event.preventDefault();
  });
  window.addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readColours(); draw(); });
  readColours();
  choose(0);
  player.dataset.ready = "true";
})();
