// Asks for one thing at a time. While one is on its way only the newest wish waits: what is stale is never asked for.

const GAP_MS = 60;

export class Newest {
  // ask(wish) returns a promise; take(answer, wish) and fail(error, wish) are called in the order of the wishes.
  constructor(ask, take, fail) {
    Object.assign(this, { ask, take, fail, wish: null, isBusy: false });
  }

  want(wish) {
    this.wish = wish;
    if (!this.isBusy) this.serve();
  }

  async serve() {
    this.isBusy = true;
    while (this.wish) {
      const wish = this.wish;
      this.wish = null;
      try {
        this.take(await this.ask(wish), wish);
      } catch (error) {
        this.fail(error, wish);
      }
      await new Promise((resolve) => { setTimeout(resolve, GAP_MS); });
    }
    this.isBusy = false;
  }
}
