"use strict";
// Search, filters, order and what is shown; a pair's card opens below its chain. The table's rows hold what is needed.
(() => {
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const one = (selector, within = document) => within.querySelector(selector);
  const main = one("main"), toolbar = one(".toolbar"), table = one(".scores"), found = one(".found");
  const heads = [...table.tHead.rows[0].cells];
  const collator = new Intl.Collator("en", { numeric: true });

  const tiles = new Map(all(".level").map((tile) => [tile.dataset.number, tile]));
  const pairs = [...table.tBodies[0].rows].map((row, order) => {
    const tile = tiles.get(row.dataset.number);
    const flags = new Set(row.dataset.flags.split(" "));
    if (row.dataset.level) flags.add(`level-${row.dataset.level}`);
    const values = { number: order };
    heads.forEach((head, column) => {
      const value = row.cells[column].dataset.value;
      values[head.dataset.sort] = head.dataset.sort === "name" ? value : value === "" ? null : Number(value);
    });
    return { row, tile, chain: tile.closest(".chain"), link: one(".tile", tile), text: row.dataset.find, flags, values };
  });
  const chains = all(".chain").map((section) => ({ section, list: one(".levels", section), pairs: [] }));
  const chainOf = new Map(chains.map((chain) => [chain.section, chain]));
  for (const pair of pairs) chainOf.get(pair.chain).pairs.push(pair);
  const place = one(".pairs"), cards = new Map(all(".pair").map((card) => [card.id.slice("pair-".length), card]));
  let open = null; // { card, pair }
  const byNumber = new Map(pairs.map((pair) => [pair.row.dataset.number, pair]));

  // What is shown: only some of many stand in the page, the others when one scrolls there, or prints.
  const SOME = 60;
  const box = one(".chains"), body = table.tBodies[0], more = one(".more");
  let wanted = "all", words = [], limit = SOME, laid = 0, waiting = [], rows = [];
  const seen = new IntersectionObserver((entries) => entries.at(-1).isIntersecting && extend(SOME), { rootMargin: "600px" });
  function filter() {
    let count = 0;
    for (const pair of pairs) {
      pair.shown = (wanted === "all" || pair.flags.has(wanted)) && words.every((word) => pair.text.includes(word));
      count += pair.shown;
    }
    found.textContent = count < pairs.length ? `${count.toLocaleString("en")} of ${pairs.length.toLocaleString("en")}` : "";
    one(".nothing").hidden = count > 0;
    lay();
  }
  function lay() {
    limit = SOME;
    laid = 0;
    waiting = chains.filter((chain) => chain.pairs.some((pair) => pair.shown));
    rows = pairs.filter((pair) => pair.shown).map((pair) => pair.row);
    box.replaceChildren();
    body.replaceChildren();
    layMore();
    if (open && !open.pair.chain.isConnected) shut();
  }
  function layMore() {
    body.append(...rows.slice(body.rows.length, limit));
    while (waiting.length && laid < limit) {
      const { section, list, pairs: own } = waiting.shift();
      const tiles = own.filter((pair) => pair.shown).map((pair) => pair.tile);
      if (tiles.length !== list.children.length || tiles.some((tile, k) => tile !== list.children[k])) list.replaceChildren(...tiles);
      laid += tiles.length;
      box.append(section);
    }
    more.hidden = laid >= rows.length && body.rows.length >= rows.length;
    seen.unobserve(more); // it tells of changes alone, and the button may be in view still
    seen.observe(more);
  }
  function extend(by) {
    limit += by;
    layMore();
  }
  one("button", more).addEventListener("click", () => extend(SOME));
  // Cards that are closed stand outside of the page, but on paper those of what is shown.
  place.replaceChildren();
  addEventListener("beforeprint", () => {
    extend(pairs.length);
    const wanted = pairs.filter((pair) => pair.shown).map((pair) => cards.get(pair.row.dataset.number));
    place.append(...wanted.filter((card) => card !== open?.card));
  });
  addEventListener("afterprint", () => place.replaceChildren());
  for (const button of all("[data-filter]")) {
    button.addEventListener("click", () => {
      wanted = button.dataset.filter;
      press(all("[data-filter]"), button);
      filter();
    });
  }
  one("input", toolbar).addEventListener("input", (event) => {
    words = event.target.value.toLowerCase().split(/\s+/).filter(Boolean);
    filter();
  });
  function reset() {
    wanted = "all";
    words = [];
    one("input", toolbar).value = "";
    press(all("[data-filter]"), one('[data-filter="all"]'));
    filter();
  }
  function press(buttons, pressed) {
    for (const button of buttons) button.setAttribute("aria-pressed", String(button === pressed));
  }

  // The order: of the pairs of a chain, and of the chains by their first pair. What has no value stays last.
  let key = "number", turned = false;
  function compare(a, b) {
    const [x, y] = [a.values[key], b.values[key]];
    if (x === null || y === null) return (x === null) - (y === null);
    const order = key === "name" ? collator.compare(x, y) : x - y;
    return turned ? -order : order;
  }
  function arrange() {
    for (const chain of chains) chain.pairs.sort(compare);
    chains.sort((a, b) => compare(a.pairs[0], b.pairs[0]));
    pairs.sort(compare);
    lay();
    for (const head of heads) {
      if (head.dataset.sort === key) head.setAttribute("aria-sort", turned ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    }
    const select = one("select", toolbar), button = one(".turn", toolbar);
    select.value = key;
    button.setAttribute("aria-pressed", String(turned));
    one("span", button).textContent = turned ? "↓" : "↑";
  }
  function sortBy(wantedKey, wantedTurn) {
    [key, turned] = [wantedKey, wantedTurn];
    arrange();
  }
  for (const head of heads) {
    one("button", head).addEventListener("click", () => sortBy(head.dataset.sort, head.dataset.sort === key && !turned));
  }
  one("select", toolbar).addEventListener("change", (event) => sortBy(event.target.value, false));
  one(".turn", toolbar).addEventListener("click", () => sortBy(key, !turned));

  // Thumbnails of the LODs, of the heat maps, or the table.
  function show(what) {
    main.classList.toggle("heat", what === "heat");
    main.classList.toggle("as-table", what === "table");
    press(all("[data-show]"), one(`[data-show="${what}"]`));
  }
  for (const button of all("[data-show]")) button.addEventListener("click", () => show(button.dataset.show));

  // One card is open at a time. Who draws in it hears "fmqm-open" and "fmqm-close" on it.
  function shut() {
    if (!open) return;
    const { card, pair } = open;
    card.dispatchEvent(new Event("fmqm-close"));
    card.classList.remove("open");
    card.remove();
    pair.link.setAttribute("aria-expanded", "false");
    open = null;
  }
  function openPair(number, isAsked) {
    const pair = byNumber.get(number), card = cards.get(number);
    if (!pair || !card) return;
    if (main.classList.contains("as-table")) show("lod");
    if (!pair.shown) reset();
    if (!pair.chain.isConnected) extend(pairs.length);
    if (open?.card !== card) {
      shut();
      pair.chain.append(card);
      card.classList.add("open");
      pair.link.setAttribute("aria-expanded", "true");
      open = { card, pair };
      card.dispatchEvent(new Event("fmqm-open"));
    }
    if (isAsked) {
      card.scrollIntoView({ block: "start" });
      one("h3", card).focus({ preventScroll: true });
    }
  }
  function close() {
    if (!open) return;
    const { link } = open.pair;
    shut();
    history.replaceState(null, "", location.pathname + location.search);
    link.focus();
  }
  function follow() {
    const number = /^#pair-(\d+)$/.exec(location.hash)?.[1];
    if (number) openPair(number, true);
  }
  main.addEventListener("click", (event) => {
    const link = event.target.closest('a[href^="#pair-"]');
    if (event.target.closest(".pair .close")) close();
    if (!link) return;
    event.preventDefault();
    if (link.getAttribute("aria-expanded") === "true") return close();
    history.replaceState(null, "", link.hash);
    follow();
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && open && !one("dialog[open]") && !event.target.closest("input, select")) close();
  });
  addEventListener("hashchange", follow);

  // What is scrolled to comes to stand below what sticks to the top.
  new ResizeObserver(() => {
    document.documentElement.style.setProperty("--toolbar", `${toolbar.offsetHeight}px`);
  }).observe(toolbar);

  filter();
  const first = one(".first a")?.hash.slice("#pair-".length) ?? (pairs.length === 1 ? pairs[0].row.dataset.number : null);
  if (location.hash) follow();
  else if (chains.length === 1 && first) openPair(first, false);
})();
