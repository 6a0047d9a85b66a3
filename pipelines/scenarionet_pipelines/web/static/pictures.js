// Thumbnails: fetched when they become visible, a few at a time, so that a connection stays free for filters.

const most = 4;
let waiting = [];
let numUnderWay = 0;
let underWay = new AbortController();

const watcher = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) {
    if (!isIntersecting) continue;
    watcher.unobserve(target);
    waiting.push(target);
  }
  fetchNext();
}, { rootMargin: "300px" });

// Load the picture at an address into an image element once it is visible.
export function showWhenSeen(image, address) {
  image.dataset.address = address;
  watcher.observe(image);
}

// Cancel the pictures of the previous page.
export function forgetPictures() {
  watcher.disconnect();
  waiting = [];
  underWay.abort();
  underWay = new AbortController();
}

async function fetchNext() {
  if (numUnderWay >= most || !waiting.length) return;
  const image = waiting.shift();
  numUnderWay += 1;
  fetchNext();
  try {
    const response = await fetch(image.dataset.address, { signal: underWay.signal, priority: "low" });
    if (!response.ok) throw new Error(response.statusText);
    await response.arrayBuffer();
    image.src = image.dataset.address; // from the browser's cache
  } catch (error) {
    if (error.name !== "AbortError") image.parentElement.classList.add("missing");
  } finally {
    numUnderWay -= 1;
    fetchNext();
  }
}
