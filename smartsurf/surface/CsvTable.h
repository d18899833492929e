// Reads tables of cells as CSV with a fixed header, for FaultMap and sensor calibrations. Private to
// smartsurf/surface.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace smartsurf::surface {

// One data row, split at its commas, with surrounding blanks and quotes removed.
class CsvRow {
 public:
  CsvRow(std::vector<std::string> fields, std::string file, int line_number)
      : fields_(std::move(fields)), file_(std::move(file)), line_number_(line_number) {}

  const std::string& text(std::size_t column) const { return fields_[column]; }
  // Parse an integer in [0, count), or a finite number. Throw scene::InputError, naming the field, if it is
  // anything else.
  int index(std::size_t column, const char* name, int count) const;
  double number(std::size_t column, const char* name) const;
  int line_number() const { return line_number_; }  // from 1
  // Throws scene::InputError with the message "FILE:LINE: clause".
  [[noreturn]] void refuse(const std::string& clause) const;

 private:
  std::vector<std::string> fields_;
  std::string file_;
  int line_number_;
};

// Quotes the first 40 bytes for a one-line message; control characters become '?'.
std::string quote(std::string_view text);

// Returns the rows after the header, skipping empty lines and comments (#). The last `optional_columns`
// fields of a row may be omitted and are then empty. Throws scene::InputError if the first line is not
// `header` or a row has the wrong number of fields.
std::vector<CsvRow> read_csv(const std::string& file, std::string_view text, std::string_view header,
                             std::size_t optional_columns = 0);

}  // namespace smartsurf::surface
