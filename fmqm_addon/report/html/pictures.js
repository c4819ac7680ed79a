// Pictures open large; the arrow keys go to the others of the same view, which stand at the same place.
(() => {
  const box = document.querySelector(".lightbox"), caption = box.querySelector("figcaption"), image = new Image();
  let group = [], at = 0;
  function show(place) {
    at = (place + group.length) % group.length;
    const link = group[at], small = link.querySelector("img");
    image.src = link.href;
    caption.before(image);
    image.alt = small.alt;
    caption.textContent = `${small.alt} (${at + 1} of ${group.length})`;
  }
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a.zoom");
    if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    group = [...link.closest(".views, .two").querySelectorAll("a.zoom")];
    show(group.indexOf(link));
    box.showModal();
  });
  box.querySelector(".before").addEventListener("click", () => show(at - 1));
  box.querySelector(".after").addEventListener("click", () => show(at + 1));
  box.querySelector(".close").addEventListener("click", () => box.close());
  box.addEventListener("click", (event) => event.target === image && show(at + 1));
  box.addEventListener("keydown", (event) => {
    if (event.key === "ArrowLeft") show(at - 1);
    if (event.key === "ArrowRight") show(at + 1);
  });
})();
