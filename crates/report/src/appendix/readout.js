// Shows the values at the point of a curve that is nearest to the pointer. The page is complete without this script.
for (const svg of document.querySelectorAll("svg.chart")) {
  const readout = svg.querySelector(".readout"), [circle, text] = readout.children;
  const points = [...svg.querySelectorAll(".curve")].flatMap((curve) => {
    const [xs, ys] = [curve.dataset.x.split(" "), curve.dataset.y.split(" ")];
    return [...curve.points].map((at, i) => ({ at, name: curve.dataset.name, x: xs[i], y: ys[i] }));
  });
  svg.addEventListener("pointermove", (event) => {
    const pointer = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    let [nearest, least] = [null, 40];
    for (const point of points) {
      const distance = Math.hypot(point.at.x - pointer.x, point.at.y - pointer.y);
      if (distance < least) [nearest, least] = [point, distance];
    }
    readout.style.display = nearest ? "inline" : "none";
    if (!nearest) return;
    const { at, name, x, y } = nearest, right = at.x > 400;
    text.textContent = `${name ? name + ": " : ""}${x}, ${y}`.replaceAll("-", "\u2212");
    for (const [key, value] of [["cx", at.x], ["cy", at.y]]) circle.setAttribute(key, value);
    text.setAttribute("x", at.x + (right ? -9 : 9));
    text.setAttribute("y", Math.max(at.y - 9, 12));
    text.setAttribute("text-anchor", right ? "end" : "start");
  });
  svg.addEventListener("pointerleave", () => { readout.style.display = "none"; });
}
