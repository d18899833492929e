#include "common/color/PaletteFile.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>
#include <sstream>

#include "common/error/UserError.h"

namespace common {
namespace {

constexpr std::size_t kMaxNameBytes = 40;

// One line of the file; throws with its number.
class PaletteLine {
 public:
  PaletteLine(const std::string& file, std::size_t line) : place_(file + ":" + std::to_string(line) + ": ") {}

  CustomPalette parse(const std::string& name, const std::vector<std::string>& colors) const {
    check_name(name);
    if (colors.size() < 2)
      fail("palette '" + name + "' has " + std::to_string(colors.size()) +
           " colours; it needs at least 2, such as " + name + " #000000 #ffffff");
    std::vector<std::optional<float>> positions;
    CustomPalette palette{name, {}};
    for (const std::string& word : colors) {
      const std::size_t at = word.find('@');
      palette.stops.push_back({0.0F, parse_color(word, std::string_view(word).substr(0, at))});
      positions.push_back(at == word.npos ? std::nullopt : std::optional(parse_position(word, at + 1)));
    }
    place(positions, palette, colors);
    return palette;
  }
  [[noreturn]] void fail(const std::string& message) const { throw UserError(place_ + message); }

 private:
  void check_name(const std::string& name) const {
    const auto valid = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; };
    if (name.size() > kMaxNameBytes || std::isalpha(static_cast<unsigned char>(name.front())) == 0 ||
        !std::all_of(name.begin(), name.end(), valid))
      fail("'" + name.substr(0, kMaxNameBytes) +
           "' is not a palette's name: a letter, then letters, digits, - and _, " +
           std::to_string(kMaxNameBytes) + " at most");
  }
  Rgb parse_color(const std::string& word, std::string_view hex) const {
    unsigned value = 0;
    const bool prefixed = hex.size() == 7 && hex.front() == '#';
    const char* end = hex.data() + hex.size();
    if (!prefixed || std::from_chars(hex.data() + 1, end, value, 16).ptr != end)
      fail("'" + word +
           "' is not a colour: #RRGGBB with hexadecimal digits, such as #ff8000 or #ff8000@0.25");
    const auto part = [&](int shift) { return static_cast<float>((value >> shift) & 0xFFU) / 255.0F; };
    return {part(16), part(8), part(0)};
  }
  float parse_position(const std::string& word, std::size_t from) const {
    float position = -1.0F;
    const char* end = word.data() + word.size();
    if (std::from_chars(word.data() + from, end, position).ptr != end ||
        !(position >= 0.0F && position <= 1.0F))
      fail("'" + word + "': the position after @ is a number from 0 to 1");
    return position;
  }
  // Fills in the positions that the file leaves out.
  void place(std::vector<std::optional<float>>& positions, CustomPalette& palette,
             const std::vector<std::string>& colors) const {
    if (!positions.front()) positions.front() = 0.0F;
    if (!positions.back()) positions.back() = 1.0F;
    for (std::size_t i = 0, previous = 0; i < positions.size(); ++i) {
      if (!positions[i]) continue;
      const float from = *positions[previous], to = *positions[i];
      if (to < from)
        fail("'" + colors[i] + "': positions must ascend; the colour before is at " + format(from));
      for (std::size_t j = previous; j <= i; ++j)
        palette.stops[j].position =
            j == i ? to
                   : from + (to - from) * static_cast<float>(j - previous) / static_cast<float>(i - previous);
      previous = i;
    }
  }
  static std::string format(float value) {
    std::ostringstream text;
    text << value;
    return text.str();
  }

  std::string place_;
};

}  // namespace

std::vector<CustomPalette> parse_palettes(std::string_view text, const std::string& file) {
  std::vector<CustomPalette> palettes;
  std::istringstream lines{std::string(text)};
  std::string line;
  for (std::size_t number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line.substr(0, line.find("//")));
    std::string name;
    if (!(words >> name)) continue;
    std::vector<std::string> colors;
    for (std::string color; words >> color;) colors.push_back(color);
    const PaletteLine at(file, number);
    CustomPalette palette = at.parse(name, colors);
    const auto same_name = [&](const CustomPalette& known) { return known.name == name; };
    if (find_palette(name) || std::any_of(palettes.begin(), palettes.end(), same_name))
      at.fail("there is already a palette '" + name + "'; choose another name");
    if (palettes.size() == kMaxCustomPalettes)
      at.fail("there are more than " + std::to_string(kMaxCustomPalettes) + " palettes");
    palettes.push_back(std::move(palette));
  }
  return palettes;
}

}  // namespace common
