// The videos of an episode follow one clock, which counts their frames; so does a line in the curves.
for (const player of document.querySelectorAll(".player")) {
  const clock = player.querySelector(".clock");
  if (!clock) continue;
  const videos = [...player.querySelectorAll("video")];
  const [button, slider, output] = clock.children;
  const [fps, frameS, endS] = ["fps", "frameS", "endS"].map((name) => Number(clock.dataset[name]));
  const last = Number(slider.max);
  const lastOf = (video) => Number(video.dataset.frames) - 1;
  const longest = videos.find((video) => lastOf(video) === last); // the clock is that of its pictures
  let frame = last; // with fractions while playing; at first the posters are shown, which are the last pictures
  let isPlaying = false;
  let placeLines = () => {}; // puts the lines in the curves where a time is

  // Moves a video to the frame, or to its last one; where it is busy, once it is ready.
  const seek = (video, isSure = false) => {
    const time = (Math.min(Math.floor(frame), lastOf(video)) + 0.5) / fps;
    const isThere = isSure && Math.abs(video.currentTime - time) < 0.25 / fps;
    if (video.readyState > 0 && !video.seeking && !isThere) video.currentTime = time;
  };

  const show = () => {
    const timeS = Math.min(Math.floor(frame) * frameS, endS);
    slider.value = Math.floor(frame);
    output.textContent = `${timeS.toFixed(2)} s`;
    slider.setAttribute("aria-valuetext", output.textContent);
    placeLines(timeS);
  };

  const load = () => {
    for (const video of videos) {
      if (video.preload === "auto") continue;
      video.preload = "auto";
      video.load();
      video.addEventListener("loadeddata", () => seek(video, true));
      video.addEventListener("seeked", () => isPlaying || seek(video, true));
    }
  };

  // Goes on from the frame.
  const follow = (video) => {
    seek(video);
    if (isPlaying && frame < lastOf(video)) video.play().catch(() => {});
  };

  const pause = () => {
    isPlaying = false;
    button.textContent = "Play";
    for (const video of videos) {
      video.pause();
      seek(video); // its picture may be ahead of the time that it tells
    }
    show();
  };

  const tick = () => {
    if (!isPlaying) return;
    if (!longest.seeking && longest.readyState > 1) frame = Math.min(longest.currentTime * fps, last);
    if (longest.ended || frame >= last) {
      frame = last;
      pause();
      return;
    }
    for (const video of videos.filter((one) => !one.ended)) {
      const ahead = video.currentTime * fps - frame;
      if (Math.abs(ahead) > 3) seek(video);
      video.playbackRate = Math.abs(ahead) < 0.25 ? 1 : ahead > 0 ? 0.9 : 1.1;
    }
    show();
    requestAnimationFrame(tick);
  };

  const toggle = () => {
    load();
    if (isPlaying) {
      pause();
      return;
    }
    if (frame >= last) frame = 0;
    isPlaying = true;
    button.textContent = "Pause";
    videos.forEach(follow);
    requestAnimationFrame(tick);
  };

  const jump = (to) => {
    load();
    frame = Math.min(Math.max(Math.round(to), 0), last);
    videos.forEach(follow);
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
    const untilS = Number(figure.dataset.untilS);
    const panels = [...svg.querySelectorAll("g[id]")].filter(({ id }) => /-axes_\d+$/.test(id)).map((axes) => {
      // the first path is the panel's background, from its lower left corner on
      const corners = axes.querySelector("path").getAttribute("d").match(/[\d.]+/g).map(Number);
      const [left, bottom, right, , , top] = corners;
      const line = document.createElementNS(svg.namespaceURI, "line");
      for (const [name, value] of Object.entries({ class: "cursor", y1: top, y2: bottom })) line.setAttribute(name, value);
      return { left, top, right, bottom, line: svg.appendChild(line) };
    });
    placeLines = (timeS) => {
      for (const { left, right, line } of panels) {
        const x = left + ((right - left) * Math.min(timeS, untilS)) / untilS;
        for (const end of ["x1", "x2"]) line.setAttribute(end, x);
      }
    };
    let held = null; // the panel in which the line is dragged
    const drag = (event) => {
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      if (event.type === "pointerdown") {
        held = panels.find(({ left, top, right, bottom }) => left <= x && x <= right && top <= y && y <= bottom);
        if (held) svg.setPointerCapture(event.pointerId);
      }
      if (held && event.buttons) jump(((x - held.left) / (held.right - held.left)) * (untilS / frameS));
    };
    svg.addEventListener("pointerdown", drag);
    svg.addEventListener("pointermove", drag);
    figure.classList.add("is-live");
  }
  clock.hidden = false;
  show();
}
