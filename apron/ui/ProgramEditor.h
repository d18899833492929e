// The source texts of the program while the user edits them, independent of drawing and of the disk.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apron/debugger/Listing.h"

namespace apron::ui {

class ProgramEditor {
 public:
  struct File {
    std::string name;
    std::string text;        // as edited
    std::string saved_text;  // as last read from or written to the disk
    // Counts the changes of `text` that do not come from the user.
    std::uint32_t revision = 0;

    bool modified() const { return text != saved_text; }
    // The first line with a character that a text widget of ImGui does not keep: one beyond 16 bits, NUL, or
    // a byte that is not UTF-8; 0: none. O(length).
    std::uint32_t uneditable_line() const;
  };
  // Writes `text` to the file `name`, which is expected to hold `old_text`.
  struct SaveRequest {
    std::string name, text, old_text;
  };
  struct Position {
    std::uint32_t line = 0, column = 1;  // 1-based
  };

  // The texts of a program that has been compiled. Files with unsaved changes keep them.
  void set_sources(const std::vector<debugger::SourceText>& sources);
  // A file as it now is on the disk, such as one that another program has changed and that no longer
  // compiles.
  void set_text_on_disk(const std::string& name, const std::string& text);
  std::vector<File>& files() { return files_; }
  // The file that is shown; nullptr before set_sources().
  File* current();
  void select(std::size_t file) { current_ = file; }
  bool modified() const;

  // Shows the editor with the cursor at that place; of an unknown file, as it was left.
  void open(const std::string& file, std::uint32_t line, std::uint32_t column = 1);
  // The place that open() asked for, once.
  std::optional<Position> take_position() { return std::exchange(position_, std::nullopt); }

  void request_save();
  std::optional<SaveRequest> take_save_request() { return std::exchange(save_request_, std::nullopt); }
  // The request has been carried out.
  void mark_saved(const SaveRequest& request);
  // The file on the disk is not what the request expected; the next request replaces it.
  void mark_conflict(const SaveRequest& request, std::string text_on_disk);
  // Discards the unsaved changes of the current file.
  void revert();

  bool shown = false;
  std::vector<debugger::SourceDiagnostic> diagnostics;  // of the latest compilation

 private:
  File* find(const std::string& name);

  std::vector<File> files_;  // the main file first
  std::size_t current_ = 0;
  std::optional<Position> position_;
  std::optional<SaveRequest> save_request_;
};

}  // namespace apron::ui
