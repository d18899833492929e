#include "apron/run/CsvText.h"

#include <charconv>
#include <cmath>
#include <vector>

#include "apron/run/MediaFile.h"
#include "apron/vm/NumberFormat.h"

namespace apron::run {
namespace {

std::string_view trim(std::string_view s) {
  const std::size_t first = s.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return s.substr(first, s.find_last_not_of(" \t\r") - first + 1);
}

std::string_view take_until(std::string_view& rest, char separator) {
  const std::size_t end = rest.find(separator);
  const std::string_view head = rest.substr(0, end);
  rest = end == std::string_view::npos ? std::string_view{} : rest.substr(end + 1);
  return head;
}

bool number(std::string_view field, float& value) {
  if (!field.empty() && field.front() == '+') field.remove_prefix(1);
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error == std::errc::result_out_of_range) {  // as every reader of floats does: infinite, or zero
    value = std::strtof(std::string(field).c_str(), nullptr);
    return true;
  }
  return error == std::errc{} && end == field.data() + field.size();
}

}  // namespace

void decode_csv(const std::string& path, std::string_view text, const vm::Plane& to) {
  std::vector<float> cells;
  std::size_t width = 0, height = 0, line = 0;
  while (!text.empty()) {
    ++line;
    std::string_view row = trim(take_until(text, '\n'));
    if (row.empty()) continue;
    std::size_t columns = 0;
    for (bool more = true; more; ++columns) {
      more = row.find(',') != std::string_view::npos;
      const std::string_view field = trim(take_until(row, ','));
      if (!number(field, cells.emplace_back()))
        refuse(path, "line " + std::to_string(line) + ", field " + std::to_string(columns + 1) + ": '" +
                         std::string(field.substr(0, 40)) + "' is not a number");
    }
    if (height > 0 && columns != width)
      refuse(path, "line " + std::to_string(line) + " has " + std::to_string(columns) +
                       " numbers, the lines above " + std::to_string(width));
    width = columns;
    ++height;
  }
  require_shape(path, width, height, to);
  for (std::uint32_t y = 0; y < to.height; ++y)
    for (std::uint32_t x = 0; x < to.width; ++x) to.row(y)[x] = cells[std::size_t{y} * to.width + x];
}

std::string encode_csv(const vm::ConstPlane& from) {
  std::string text;
  vm::NumberBuffer buffer;
  for (std::uint32_t y = 0; y < from.height; ++y)
    for (std::uint32_t x = 0; x < from.width; ++x) {
      text += vm::format_number(from.row(y)[x], buffer);
      text += x + 1 < from.width ? ',' : '\n';
    }
  return text;
}

}  // namespace apron::run
