// Lists of words, words in lower case, words of a shell and texts of TOML.
#pragma once

#include <algorithm>
#include <cctype>
#include <functional>
#include <string>
#include <string_view>

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

// A sentence with a capital at its beginning, unless a file's name stands there: "sort.lua:3: …".
inline std::string with_capital(std::string sentence) {
  const std::string_view first = std::string_view(sentence).substr(0, sentence.find_first_of(" :"));
  if (!first.empty() && first.find_first_of("./_") == first.npos)
    sentence.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(sentence.front())));
  return sentence;
}

// As a user types it for one argument of a command: quoted, unless all of its characters stand for
// themselves.
inline std::string shell_word(const std::string& text) {
  const auto is_plain = [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte >= 0x80 || std::isalnum(byte) != 0 ||
           std::string_view("_-./+,:@%").find(c) != std::string_view::npos;
  };
  if (!text.empty() && std::ranges::all_of(text, is_plain)) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

// As a value of TOML, which allows no control characters.
inline std::string toml_text(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < ' ' || byte == 0x7F)
      quoted.append("\\u00").append({kDigits[byte / 16], kDigits[byte % 16]});
    else
      quoted.append(c == '"' || c == '\\' ? "\\" : "").append(1, c);
  }
  return quoted + '"';
}

}  // namespace common
