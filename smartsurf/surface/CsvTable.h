// A table of cells as CSV with a fixed header. Internal to the room: FaultMap and Calibration give it
// meaning.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace smartsurf::surface {

// One line that is neither empty nor a comment (#) nor the header, cut at its commas, with blanks and quotes
// removed.
class CsvRow {
 public:
  CsvRow(std::vector<std::string> fields, std::string file, int line_number)
      : fields_(std::move(fields)), file_(std::move(file)), line_number_(line_number) {}

  const std::string& text(std::size_t column) const { return fields_[column]; }
  // Each throws scene::InputError where the field is something else.
  int index(std::size_t column, const char* name, int count) const;  // 0 to count - 1
  double number(std::size_t column, const char* name) const;         // finite
  int line_number() const { return line_number_; }                   // of the file, from 1
  // Throws scene::InputError, "FILE:LINE: " and the clause.
  [[noreturn]] void refuse(const std::string& clause) const;

 private:
  std::vector<std::string> fields_;
  std::string file_;
  int line_number_;
};

// Text in quotes, fit for a message of one line.
std::string quoted(std::string_view text);

// Throws scene::InputError where the first line is not the header or a line has another number of fields; the
// last `optional` of them may be left out, and are then empty.
std::vector<CsvRow> read_csv(const std::string& file, std::string_view text, std::string_view header,
                             std::size_t optional_columns = 0);

}  // namespace smartsurf::surface
