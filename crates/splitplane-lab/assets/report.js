"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);

  // Dark or light: as the reader's system has it, until the button is pressed.
  const root = document.documentElement;
  document.getElementById("theme").addEventListener("click", () => {
    const dark = root.dataset.theme
      ? root.dataset.theme === "dark"
      : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
  });

  // Plots take the colour of the text around them, so that they suit both.
  const config = {
    background: null,
    font: getComputedStyle(document.body).fontFamily,
    view: { stroke: null },
    axis: {
      labelColor: "currentColor", titleColor: "currentColor", domainColor: "currentColor",
      tickColor: "currentColor", gridColor: "currentColor", gridOpacity: 0.13, domainOpacity: 0.5,
      tickOpacity: 0.5, titleFontWeight: "normal",
    },
    // Labels stay under their ticks and keep apart on narrow screens, too.
    axisX: { labelFlush: false, labelOverlap: "greedy", labelSeparation: 6 },
    legend: { labelColor: "currentColor", titleColor: "currentColor", orient: "bottom", columns: 4, symbolLimit: 40, labelLimit: 130 },
  };
  const options = { renderer: "svg", config, actions: { export: true, source: false, compiled: false, editor: false } };
  const drawn = [];
  for (const place of document.querySelectorAll("[data-plot]")) {
    const name = place.dataset.plot;
    const spec = { ...data.plots[name], autosize: { type: "fit-x", contains: "padding" } };
    if (!spec.height) spec.height = 230;
    drawn.push(vegaEmbed(place, spec, { ...options, downloadFileName: name }));
  }
  let views = [];
  Promise.all(drawn).then(
    (plots) => { views = plots.map((plot) => plot.view); root.dataset.plots = String(drawn.length); },
    (error) => { console.error(error); },
  );

  // A picture of grey values, as an array of values in [0, 1]; grey is the square root.
  const decode = (source) => new Promise((resolve, reject) => {
    const image = new Image();
    image.onload = () => {
      const canvas = document.createElement("canvas");
      canvas.width = image.width;
      canvas.height = image.height;
      const context = canvas.getContext("2d", { willReadFrequently: true });
      context.drawImage(image, 0, 0);
      const bytes = context.getImageData(0, 0, image.width, image.height).data;
      const values = new Float32Array(image.width * image.height);
      for (let i = 0; i < values.length; i++) values[i] = (bytes[4 * i] / 255) ** 2;
      resolve(values);
    };
    image.onerror = () => reject(new Error("a picture cannot be read"));
    image.src = source;
  });

  const short = (value) => value.toLocaleString("en", { maximumSignificantDigits: 4 });

  const gallery = async (place, given) => {
    const find = (role) => place.querySelector(`[data-role="${role}"]`);
    const { width, height } = given;
    const decoded = await Promise.all(
      given.trees.map((tree) => Promise.all(tree.quantities.map((q) => decode(q.grey)))),
    );
    find("picture").src = given.picture;

    const quantity = () => Number(find("quantity").value);
    const end = (tree) => find("scale").value === "common"
      ? given.ends[quantity()]
      : given.trees[tree].quantities[quantity()].own;
    const paint = (canvas, tree) => {
      canvas.width = width;
      canvas.height = height;
      const context = canvas.getContext("2d");
      const pixels = context.createImageData(width, height);
      const values = decoded[tree][quantity()];
      const factor = given.trees[tree].quantities[quantity()].end / end(tree);
      for (let i = 0; i < values.length; i++) {
        const colour = data.colours[Math.min(255, Math.floor(256 * values[i] * factor))];
        pixels.data.set(colour, 4 * i);
        pixels.data[4 * i + 3] = 255;
      }
      context.putImageData(pixels, 0, 0);
    };

    const wipe = place.querySelector(".wipe");
    const slider = find("wipe");
    const showWipe = () => {
      const at = Number(slider.value);
      find("over").style.clipPath = `inset(0 0 0 ${at}%)`;
      wipe.querySelector(".handle").style.left = `${at}%`;
    };
    const show = () => {
      const [left, right] = [Number(find("left").value), Number(find("right").value)];
      paint(find("under"), left);
      paint(find("over"), right);
      wipe.querySelector(".left-name").textContent = given.trees[left].tree;
      wipe.querySelector(".right-name").textContent = given.trees[right].tree;
      const common = find("scale").value === "common";
      find("bar-middle").textContent = common
        ? `${short(given.ends[quantity()] / 2)} (${given.labels[quantity()]} per sample)`
        : given.labels[quantity()] + " per sample";
      find("bar-high").textContent = common
        ? short(given.ends[quantity()])
        : `left ${short(end(left))}, right ${short(end(right))}`;
      for (const figure of place.querySelectorAll("[data-tree]")) {
        const tree = Number(figure.dataset.tree);
        paint(figure.querySelector("canvas"), tree);
        figure.querySelector(".end").textContent = common ? "" : `to ${short(end(tree))}`;
      }
      showWipe();
    };

    const bar = find("bar").getContext("2d");
    const colours = bar.createImageData(256, 1);
    data.colours.forEach((colour, i) => { colours.data.set([...colour, 255], 4 * i); });
    bar.putImageData(colours, 0, 0);

    slider.addEventListener("input", showWipe);
    for (const role of ["quantity", "scale", "left", "right"]) find(role).addEventListener("change", show);
    const drag = (event) => {
      const box = wipe.getBoundingClientRect();
      slider.value = 100 * Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
      showWipe();
    };
    wipe.addEventListener("pointerdown", (event) => { wipe.setPointerCapture(event.pointerId); drag(event); });
    wipe.addEventListener("pointermove", (event) => { if (event.buttons) drag(event); });
    for (const figure of place.querySelectorAll("[data-tree]")) {
      const choose = () => { find("right").value = figure.dataset.tree; show(); };
      figure.addEventListener("click", choose);
      figure.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(); } });
    }
    show();
  };
  const places = [...document.querySelectorAll("[data-gallery]")];
  Promise.all(places.map((place) => gallery(place, data.galleries[Number(place.dataset.gallery)]))).then(
    () => { root.dataset.galleries = String(places.length); },
    (error) => { console.error(error); },
  );

  // On paper everything is open, and plots are drawn for half of its width: what was drawn for a
  // window would be scaled, letters and all.
  const widen = (width) => { for (const view of views) view.signal("width", width(view.container())).run(); };
  addEventListener("beforeprint", () => {
    for (const details of document.querySelectorAll("main details.cards")) details.open = true;
    widen(() => 350);
  });
  addEventListener("afterprint", () => { widen((place) => place.clientWidth); });
})();
