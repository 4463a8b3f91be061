// Films are fetched when they come near the screen.

export function watchFilms(root) {
  for (const box of root.querySelectorAll("[data-film]")) {
    const looking = new IntersectionObserver(async (entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      looking.disconnect();
      const { openFilm } = await import("./film.js");
      openFilm(box);
    }, { rootMargin: "200px" });
    looking.observe(box);
  }
}
