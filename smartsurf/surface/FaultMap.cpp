#include "smartsurf/surface/FaultMap.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace smartsurf::surface {
namespace {

constexpr std::string_view kHeader = "row,column,channel,fault,value";

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\"";
  const auto begin = text.find_first_not_of(kBlank);
  if (begin == text.npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

std::string quoted(std::string_view text) {
  std::string shown(text.substr(0, 40));
  for (char& c : shown)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return "'" + shown + "'";
}

template <class Number>
std::optional<Number> number_of(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// One line of the file, with its place for messages.
class Line {
 public:
  Line(std::string_view text, std::string place) : text_(text), place_(std::move(place)) {}

  [[noreturn]] void refuse(const std::string& clause) const {
    throw scene::InputError(place_ + ": " + clause);
  }

  std::array<std::string_view, 5> fields() const {
    std::array<std::string_view, 5> found;
    std::size_t count = 0, begin = 0;
    while (begin <= text_.size()) {
      const std::size_t end = std::min(text_.find(',', begin), text_.size());
      if (count < found.size()) found[count] = trimmed(text_.substr(begin, end - begin));
      ++count;
      begin = end + 1;
    }
    if (count < 4 || count > 5) refuse(std::to_string(count) + " values: must be 5, " + std::string(kHeader));
    return found;
  }

  int index(std::string_view text, const char* what, int count) const {
    const auto value = number_of<int>(text);
    if (!value || *value < 0 || *value >= count)
      refuse(std::string(what) + " = " + quoted(text) + ": must be 0 to " + std::to_string(count - 1));
    return *value;
  }

  std::optional<double> value(std::string_view text) const {
    if (text.empty()) return std::nullopt;
    const auto number = number_of<double>(text);
    if (!number || !std::isfinite(*number)) refuse("value = " + quoted(text) + ": must be a finite number");
    return number;
  }

 private:
  std::string_view text_;
  std::string place_;
};

}  // namespace

FaultMap::FaultMap(const scene::FaultMapFile& file, int rows, int columns) : name_(file.name) {
  std::string_view rest = file.text;
  if (rest.starts_with("\xef\xbb\xbf")) rest.remove_prefix(3);
  bool header = false;
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view text = trimmed(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (text.empty() || text.starts_with('#')) continue;
    const Line line(text, name_ + ":" + std::to_string(number));
    const auto field = line.fields();
    if (!header) {
      if (field != std::array<std::string_view, 5>{"row", "column", "channel", "fault", "value"})
        line.refuse("the first line must be the header " + std::string(kHeader));
      header = true;
      continue;
    }
    if (field[3].empty()) line.refuse("fault: must not be empty");
    entries_.push_back({line.index(field[0], "row", rows), line.index(field[1], "column", columns),
                        std::string(field[2]), std::string(field[3]), line.value(field[4]), number});
  }
  if (!header) throw scene::InputError(name_ + ": no header; the first line must be " + std::string(kHeader));
}

void FaultMap::refuse(const FaultEntry& entry, const std::string& clause) const {
  throw scene::InputError(name_ + ":" + std::to_string(entry.line) + ": " + clause);
}

void FaultMap::require_channels(const std::vector<std::string>& known) const {
  for (const FaultEntry& entry : entries_) {
    if (entry.channel.empty() || std::ranges::find(known, entry.channel) != known.end()) continue;
    std::string near = scene::nearest_name(entry.channel, known), all;
    for (const std::string& name : known) all += (all.empty() ? "" : ", ") + name;
    refuse(entry, "channel " + quoted(entry.channel) + ": no such channel" +
                      (near.empty() ? "; known: " + all : " (did you mean '" + near + "'?)"));
  }
}

}  // namespace smartsurf::surface
