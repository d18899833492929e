#include "common/text/Suggestion.h"

#include <algorithm>
#include <cstddef>

#include "common/text/Words.h"

namespace common {
namespace {

constexpr std::size_t kMaxNameLength = 64;  // the edit distance takes quadratic time

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = a[i - 1] == b[j - 1] ? 0 : 1;
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + change});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

// "abs" of "core.abs".
std::string_view unqualified_name(std::string_view name) { return name.substr(name.rfind('.') + 1); }

// The same word in another group, such as math.abs for abs.
bool same_unqualified_name(std::string_view name, std::string_view candidate) {
  return unqualified_name(name).size() >= 2 && unqualified_name(name) == unqualified_name(candidate);
}

std::size_t score(std::string_view name, std::string_view candidate) {
  if (candidate == name) return SIZE_MAX;
  if (lower_case(std::string(candidate)) == lower_case(std::string(name))) return 0;
  const std::size_t allowed = name.size() <= 1 ? 0 : name.size() <= 4 ? 1 : name.size() <= 8 ? 2 : 3;
  const bool too_different =
      candidate.size() > name.size() + allowed || name.size() > candidate.size() + allowed;
  const std::size_t edits = too_different ? SIZE_MAX : edit_distance(name, candidate);
  const bool close = edits <= allowed && edits < std::max(name.size(), candidate.size());
  if (same_unqualified_name(name, candidate)) return close ? 1 : 2;  // better than any other edit
  return close ? 2 + edits : SIZE_MAX;
}

}  // namespace

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
  if (name.empty() || name.size() > kMaxNameLength) return {};
  std::string best;
  std::size_t best_score = SIZE_MAX;
  for (const std::string& candidate : candidates) {
    const std::size_t value = score(name, candidate);
    if (value < best_score || (value == best_score && value != SIZE_MAX && candidate < best)) {
      best = candidate;
      best_score = value;
    }
  }
  return best;
}

std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates) {
  const std::string best = nearest_name(name, candidates);
  return best.empty() ? "" : "; did you mean '" + best + "'?";
}

}  // namespace common
