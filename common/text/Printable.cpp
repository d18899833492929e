#include "common/text/Printable.h"

namespace common {

std::string printable(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if (c == 0xC2 && next >= 0x80 && next < 0xA0) {  // U+0080 to U+009F
      result += '?';
      ++i;
    } else {
      result += c < 0x20 || c == 0x7F ? '?' : static_cast<char>(c);
    }
  }
  return result;
}

}  // namespace common
