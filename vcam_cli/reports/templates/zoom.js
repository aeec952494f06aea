// Pictures of one group zoom together: wheel with Ctrl, double click, drag; + - 0 and arrows on the
// keyboard. The page is whole without this.
(() => {
  const groups = {};
  for (const frame of document.querySelectorAll(".frame[data-group]")) {
    (groups[frame.dataset.group] ||= []).push(frame);
  }
  for (const frames of Object.values(groups)) {
    let scale = 1, x = 0, y = 0;  // magnification; upper-left corner, as a share of the picture
    const clamp = (value, most) => Math.min(Math.max(value, 0), most);
    const show = () => {
      const rest = 1 - 1 / scale;
      x = clamp(x, rest);
      y = clamp(y, rest);
      for (const frame of frames) {
        for (const image of frame.children) {
          image.style.transform = `scale(${scale}) translate(${-100 * x}%, ${-100 * y}%)`;
        }
        frame.classList.toggle("near", scale > 1);
      }
    };
    const zoom = (factor, atX = 0.5, atY = 0.5) => {
      const next = Math.min(Math.max(scale * factor, 1), 32);
      x += atX / scale - atX / next;
      y += atY / scale - atY / next;
      scale = next;
      show();
    };
    const place = (event, frame) => {
      const box = frame.getBoundingClientRect();
      return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    };
    const keys = {
      "+": () => zoom(1.5), "=": () => zoom(1.5), "-": () => zoom(1 / 1.5),
      "0": () => { scale = 1; show(); },
      ArrowLeft: () => { x -= 0.1 / scale; show(); }, ArrowRight: () => { x += 0.1 / scale; show(); },
      ArrowUp: () => { y -= 0.1 / scale; show(); }, ArrowDown: () => { y += 0.1 / scale; show(); },
    };
    for (const frame of frames) {
      frame.classList.add("linked");
      frame.tabIndex = 0;
      frame.addEventListener("keydown", (event) => {
        const arrow = event.key.startsWith("Arrow");
        if (event.ctrlKey || event.metaKey || !keys[event.key] || (arrow && scale === 1)) return;
        event.preventDefault();
        keys[event.key]();
      });
      frame.addEventListener("dblclick", (event) => zoom(2, ...place(event, frame)));
      frame.addEventListener("wheel", (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        zoom(Math.exp(-event.deltaY / 200), ...place(event, frame));
      }, { passive: false });
      frame.addEventListener("pointerdown", (event) => {
        if (scale === 1) return;
        event.preventDefault();
        frame.focus();
        frame.setPointerCapture(event.pointerId);
      });
      frame.addEventListener("pointermove", (event) => {
        if (scale === 1 || !frame.hasPointerCapture(event.pointerId)) return;
        x -= event.movementX / frame.clientWidth / scale;
        y -= event.movementY / frame.clientHeight / scale;
        show();
      });
    }
    const hint = document.createElement("p");
    hint.className = "hint";
    hint.textContent = "Zoom: double click or Ctrl and wheel, drag; or Tab to a picture, then + - 0"
      + " and arrows. All pictures here move together.";
    frames[0].closest(".pictures").before(hint);
  }
})();
