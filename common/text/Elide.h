// Shortens texts for which there is not enough room.
#pragma once

#include <string>
#include <string_view>

namespace common {

// The text if it fits, else as many of its characters as fit, from both ends alike, around "...": names that
// are numbered at their end stay apart. The text is UTF-8. fits(text): whether a text fits; with a text, all
// shorter ones do.
template <class Fits>
std::string elide_middle(std::string_view text, const Fits& fits) {
  if (std::string whole(text); text.size() < 2 || fits(whole)) return whole;
  const auto is_start = [&](std::size_t i) { return i == text.size() || (text[i] & 0xC0) != 0x80; };
  // kept: bytes; whole characters of them.
  const auto elided = [&](std::size_t kept) {
    std::size_t head = kept - kept / 2, tail = text.size() - kept / 2;
    while (!is_start(head)) --head;
    while (!is_start(tail)) ++tail;
    return std::string(text.substr(0, head)).append("...").append(text.substr(tail));
  };
  std::size_t kept = 1, too_long = text.size();
  while (too_long - kept > 1) {
    const std::size_t middle = kept + (too_long - kept) / 2;
    (fits(elided(middle)) ? kept : too_long) = middle;
  }
  return elided(kept);
}

}  // namespace common
