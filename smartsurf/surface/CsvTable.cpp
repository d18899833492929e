#include "smartsurf/surface/CsvTable.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/csv/Csv.h"
#include "common/text/Utf8.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::surface {
namespace {

std::vector<std::string> split_fields(std::string_view text) {
  const std::vector<std::string_view> fields = common::split_csv_line(text);
  return {fields.begin(), fields.end()};
}

}  // namespace

std::string quote(std::string_view text) {
  std::string printable(text.substr(0, 40));
  for (char& c : printable)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return "'" + printable + "'";
}

void CsvRow::refuse(const std::string& clause) const {
  throw scene::InputError(file_ + ":" + std::to_string(line_number_) + ": " + clause);
}

int CsvRow::index(std::size_t column, const char* name, int count) const {
  const auto value = common::parse_csv_number<int>(fields_[column]);
  if (!value || *value < 0 || *value >= count)
    refuse(std::string(name) + " = " + quote(fields_[column]) + ": must be 0 to " +
           std::to_string(count - 1));
  return *value;
}

double CsvRow::number(std::size_t column, const char* name) const {
  const auto value = common::parse_csv_number<double>(fields_[column]);
  if (!value || !std::isfinite(*value))
    refuse(std::string(name) + " = " + quote(fields_[column]) + ": must be a finite number");
  return *value;
}

std::vector<CsvRow> read_csv(const std::string& file, std::string_view text, std::string_view header,
                             std::size_t optional_columns) {
  text = common::without_byte_order_mark(text);
  const std::vector<std::string> column_names = split_fields(header);
  std::vector<CsvRow> rows;
  bool has_header = false;
  for (int line_number = 1; !text.empty(); ++line_number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view raw_line = text.substr(0, end), content = common::trim_csv_field(raw_line);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (content.empty() || content.starts_with('#')) continue;
    const bool quotes_close = std::ranges::count(raw_line, '"') % 2 == 0;
    std::vector<std::string> fields = split_fields(content);
    const std::size_t count = fields.size();
    const bool is_header = fields == column_names;
    fields.resize(column_names.size());
    CsvRow row(std::move(fields), file, line_number);
    if (!quotes_close) row.refuse("a quotation mark is not closed");
    if (!has_header && !is_header) row.refuse("the first line must be the header " + std::string(header));
    if (count > column_names.size() || count + optional_columns < column_names.size())
      row.refuse(std::to_string(count) + " values: must be " + std::to_string(column_names.size()) + ", " +
                 std::string(header));
    if (has_header) rows.push_back(std::move(row));
    has_header = true;
  }
  if (!has_header)
    throw scene::InputError(file + ": no header; the first line must be " + std::string(header));
  return rows;
}

}  // namespace smartsurf::surface
