// Lists of words, and words in lower case.
#pragma once

#include <cctype>
#include <functional>
#include <string>

namespace common {

// "a, b, c"; `text_of` turns an element into its text.
template <class Elements, class TextOf = std::identity>
std::string join(const Elements& elements, TextOf text_of = {}) {
  std::string joined;
  for (const auto& element : elements)
    joined.append(joined.empty() ? "" : ", ").append(std::invoke(text_of, element));
  return joined;
}

inline std::string lower_case(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

}  // namespace common
