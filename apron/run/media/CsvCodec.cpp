#include "apron/run/media/CsvCodec.h"

#include <fmt/format.h>

#include <vector>

#include "apron/run/media/MediaFile.h"
#include "apron/vm/NumberFormat.h"
#include "common/csv/Csv.h"
#include "common/text/Utf8.h"

namespace apron::run {
namespace {

std::string_view split_off(std::string_view& rest, char separator) {
  const std::size_t end = rest.find(separator);
  const std::string_view head = rest.substr(0, end);
  rest = end == std::string_view::npos ? std::string_view{} : rest.substr(end + 1);
  return head;
}

// Floats are rounded once; integers are exact.
std::optional<double> parse_cell(std::string_view field, vm::CellType type) {
  if (program::is_integer(type)) return common::parse_csv_number<double>(field);
  const auto value = common::parse_csv_number<float>(field);
  return value ? std::optional<double>(*value) : std::nullopt;
}

}  // namespace

void decode_csv(const std::string& path, std::string_view text, const vm::Plane& to) {
  std::vector<double> cells;
  std::size_t width = 0, height = 0, line = 0;
  text = common::without_byte_order_mark(text);
  while (!text.empty()) {
    ++line;
    const std::string_view row = common::trim_csv_field(split_off(text, '\n'));
    if (row.empty()) continue;
    std::size_t columns = 0;
    for (const std::string_view field : common::split_csv_line(row)) {
      ++columns;
      const auto value = parse_cell(field, to.type);
      if (!value)
        throw_refused(
            path, fmt::format("line {}, field {}: '{}' is not a number", line, columns, field.substr(0, 40)));
      cells.push_back(*value);
    }
    if (height > 0 && columns != width)
      throw_refused(path,
                    fmt::format("line {} has {} numbers, but the lines above have {}", line, columns, width));
    width = columns;
    ++height;
  }
  require_shape(path, width, height, to);
  for (std::uint32_t y = 0; y < to.height; ++y)
    for (std::uint32_t x = 0; x < to.width; ++x)
      store_cell(path, to, x, y, cells[std::size_t{y} * to.width + x]);
}

std::string encode_csv(const vm::ConstPlane& from) {
  std::string text;
  vm::NumberBuffer buffer;
  for (std::uint32_t y = 0; y < from.height; ++y)
    for (std::uint32_t x = 0; x < from.width; ++x) {
      text += program::is_integer(from.type) ? vm::format_number(vm::cell_value(from, x, y), buffer)
                                             : vm::format_number(from.row(y)[x], buffer);
      text += x + 1 < from.width ? ',' : '\n';
    }
  return text;
}

}  // namespace apron::run
