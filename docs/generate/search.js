// The search of the site, without a server: index.js, written by search.py, has the weights of all words.

function searchWords (text) {
  var plain = text.toLowerCase().normalize("NFKD").replace(/[\u0300-\u036f]/g, "");
  return (plain.match(/[a-z0-9]+/g) || []).map(function (word) {
    return word.replace(/^(.*[a-z]{2}[a-rt-z])s$/, "$1");
  });
}

// The entries that have words of a query, the best first: the sum of weights, times the share of the words that they have.
function searchHits (index, query) {
  var scores = {}, found = {};
  var words = searchWords(query).filter(function (word) { return !index.ignored.includes(word); });
  words.forEach(function (word) {
    var terms = Object.hasOwn(index.weights, word) ? [word] : Object.keys(index.weights).filter(function (term) {
      return term.startsWith(word);
    });
    var best = {};
    terms.forEach(function (term) {
      index.weights[term].forEach(function (pair) { best[pair[0]] = Math.max(best[pair[0]] || 0, pair[1]); });
    });
    Object.keys(best).forEach(function (i) {
      scores[i] = (scores[i] || 0) + best[i];
      found[i] = (found[i] || 0) + 1;
    });
  });
  return Object.keys(scores).map(function (i) {
    return [scores[i] * found[i] / words.length, index.entries[i]];
  }).sort(function (a, b) { return b[0] - a[0]; }).map(function (hit) { return hit[1]; });
}

function showHits (input, results) {
  results.replaceChildren();
  var hits = searchHits(search_index, input.value).slice(0, 30);
  hits.forEach(function (hit) {
    var article = document.createElement("article"), heading = document.createElement("h3");
    var link = document.createElement("a"), text = document.createElement("p");
    link.href = base_url + "/" + hit[0];
    link.textContent = hit[1];
    text.textContent = hit[2];
    heading.append(link);
    article.append(heading, text);
    results.append(article);
  });
  if (!hits.length) {
    results.append(results.getAttribute("data-no-results-text"));
  }
}

if (typeof document !== "undefined") {
  var input = document.getElementById("mkdocs-search-query");
  if (input) {
    var index = document.createElement("script");
    index.src = base_url + "/search/index.js";
    index.onload = function () {
      var results = document.getElementById("mkdocs-search-results");
      input.value = new URLSearchParams(window.location.search).get("q") || "";
      input.addEventListener("input", function () { showHits(input, results); });
      showHits(input, results);
    };
    document.head.append(index);
  }
}
