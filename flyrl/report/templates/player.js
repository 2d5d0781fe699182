// The videos of a terrain follow one clock, which counts their frames; so does a line in the curves.
for (const player of document.querySelectorAll(".player")) {
  const clock = player.querySelector(".clock");
  if (!clock) continue;
  const videos = [...player.querySelectorAll("video")];
  const [button, slider, output] = clock.children;
  const fps = Number(clock.dataset.fps);
  const frameS = Number(clock.dataset.frameS);
  const endS = Number(clock.dataset.endS);
  const last = Number(slider.max);
  let frame = last; // with fractions while playing; at first the posters are shown, which are the last pictures
  let isPlaying = false;
  let isAwake = false;
  let before = 0;
  let place = () => {}; // puts the lines in the curves where a time is

  const lastOf = (video) => Number(video.dataset.frames) - 1;
  const longest = videos.find((video) => lastOf(video) === last); // the clock is that of its pictures

  const leads = () => !longest.paused && !longest.seeking && longest.readyState > 2;

  // Shows the frame of a video that stands still; where it is busy, once it is ready.
  const stand = (video) => {
    const ran = !video.paused; // its picture may be ahead of the time that it tells
    video.pause();
    if (video.readyState === 0 || video.seeking) return;
    const time = (Math.min(Math.floor(frame), lastOf(video)) + 0.5) / fps;
    if (ran || Math.abs(video.currentTime - time) > 0.25 / fps) video.currentTime = time;
  };

  // Keeps a video that plays in step with the clock: a little off, it runs faster or slower.
  const follow = (video) => {
    if (video === longest && leads()) return;
    if (frame >= lastOf(video)) {
      stand(video);
      return;
    }
    if (video.paused) video.play().catch(() => {}); // where it may not play, it is moved along
    const ahead = video.currentTime * fps - frame;
    if (Math.abs(ahead) > 3) {
      if (!video.seeking) video.currentTime = frame / fps;
    } else {
      const rate = Math.abs(ahead) < 0.25 ? 1 : ahead > 0 ? 0.9 : 1.1;
      if (video.playbackRate !== rate) video.playbackRate = rate;
    }
  };

  const show = () => {
    const timeS = Math.min(Math.floor(frame) * frameS, endS);
    const text = `${timeS.toFixed(2)} s`;
    slider.value = Math.floor(frame);
    slider.setAttribute("aria-valuetext", text);
    output.textContent = text;
    place(timeS);
  };

  const wake = () => {
    if (isAwake) return;
    isAwake = true;
    for (const video of videos) {
      const settle = () => isPlaying || stand(video);
      video.addEventListener("loadeddata", settle);
      video.addEventListener("seeked", settle);
      video.preload = "auto";
      video.load();
    }
  };

  const pause = () => {
    isPlaying = false;
    button.textContent = "Play";
    videos.forEach(stand);
    show();
  };

  const tick = (now) => {
    if (!isPlaying) return;
    // a page that was out of sight stood still
    const elapsed = Math.min(Math.max(now - before, 0), 200) / 1000;
    frame = Math.min(last, leads() ? longest.currentTime * fps : frame + fps * elapsed);
    before = now;
    if (frame >= last) {
      pause();
      return;
    }
    videos.forEach(follow);
    show();
    requestAnimationFrame(tick);
  };

  const toggle = () => {
    wake();
    if (isPlaying) {
      pause();
      return;
    }
    if (frame >= last) frame = 0;
    isPlaying = true;
    button.textContent = "Pause";
    before = performance.now();
    requestAnimationFrame(tick);
  };

  const jump = (to) => {
    wake();
    frame = Math.min(Math.max(Math.round(to), 0), last);
    if (!isPlaying) videos.forEach(stand);
    show();
  };

  window.addEventListener("hashchange", () => {
    if (isPlaying && player.closest(".page").hidden) pause(); // its reader has gone to another page
  });
  button.addEventListener("click", toggle);
  slider.addEventListener("input", () => jump(Number(slider.value)));
  for (const video of videos) {
    video.controls = false;
    video.addEventListener("click", toggle);
  }

  const figure = player.querySelector(".run-along");
  if (figure) {
    const svg = figure.querySelector("svg");
    const panels = JSON.parse(figure.dataset.panels);
    const untilS = Number(figure.dataset.untilS);
    const lines = panels.map(([, top, , bottom]) => {
      const line = document.createElementNS(svg.namespaceURI, "line");
      line.setAttribute("class", "cursor");
      line.setAttribute("y1", top);
      line.setAttribute("y2", bottom);
      svg.append(line);
      return line;
    });
    place = (timeS) => {
      lines.forEach((line, index) => {
        const [left, , right] = panels[index];
        const x = left + ((right - left) * Math.min(timeS, untilS)) / untilS;
        line.setAttribute("x1", x);
        line.setAttribute("x2", x);
      });
    };
    const pointAt = (event) =>
      new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    const moveTo = (x, [left, , right]) => jump(((x - left) / (right - left)) * (untilS / frameS));
    let held = null; // the panel in which the line is dragged
    svg.addEventListener("pointerdown", (event) => {
      const { x, y } = pointAt(event);
      held = panels.find(([left, top, right, bottom]) => left <= x && x <= right && top <= y && y <= bottom);
      if (!held) return;
      svg.setPointerCapture(event.pointerId);
      moveTo(x, held);
    });
    svg.addEventListener("pointermove", (event) => {
      if (held) moveTo(pointAt(event).x, held);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      svg.addEventListener(end, () => { held = null; });
    }
    figure.classList.add("is-live");
  }
  clock.hidden = false;
  show();
}
