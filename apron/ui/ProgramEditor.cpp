#include "apron/ui/ProgramEditor.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "common/text/Utf8.h"

namespace apron::ui {

std::uint32_t ProgramEditor::File::uneditable_line() const {
  std::uint32_t line = 1;
  for (std::string_view rest = text; !rest.empty();) {
    const auto [code, bytes] = common::decode_utf8(rest);
    if (code == 0 || code > 0xFFFF) return line;
    if (code == '\n') ++line;
    rest.remove_prefix(bytes);
  }
  return 0;
}

void ProgramEditor::set_sources(const std::vector<debugger::SourceText>& sources) {
  std::vector<File> files;
  const std::string shown_name = current() != nullptr ? current()->name : "";
  for (const debugger::SourceText& source : sources) {
    const auto same_name = [&](const File& file) { return file.name == source.name; };
    if (std::ranges::any_of(files, same_name)) continue;  // included twice
    File file{source.name, source.text, source.text};
    if (const File* old = find(source.name)) {
      file.revision = old->revision;
      if (old->modified())
        file.text = old->text;
      else if (old->text != file.text)
        ++file.revision;
    }
    files.push_back(std::move(file));
  }
  files_ = std::move(files);
  const File* kept = find(shown_name);
  current_ = kept != nullptr ? kept - files_.data() : 0;
}

void ProgramEditor::set_text_on_disk(const std::string& name, const std::string& text) {
  File* file = find(name);
  if (file == nullptr || file->modified() || file->text == text) return;
  file->text = file->saved_text = text;
  ++file->revision;
}

ProgramEditor::File* ProgramEditor::current() {
  return current_ < files_.size() ? &files_[current_] : nullptr;
}

ProgramEditor::File* ProgramEditor::find(const std::string& name) {
  const auto found = std::ranges::find(files_, name, &File::name);
  return found == files_.end() ? nullptr : &*found;
}

bool ProgramEditor::modified() const { return std::ranges::any_of(files_, &File::modified); }

void ProgramEditor::open(const std::string& file, std::uint32_t line, std::uint32_t column) {
  shown = true;
  const File* wanted = find(file);
  if (wanted == nullptr) return;
  current_ = wanted - files_.data();
  if (line > 0) position_ = Position{line, std::max(column, 1U)};
}

void ProgramEditor::request_save() {
  if (const File* file = current()) save_request_ = SaveRequest{file->name, file->text, file->saved_text};
}

void ProgramEditor::mark_saved(const SaveRequest& request) {
  if (File* file = find(request.name)) file->saved_text = request.text;
}

void ProgramEditor::mark_conflict(const SaveRequest& request, std::string text_on_disk) {
  if (File* file = find(request.name)) file->saved_text = std::move(text_on_disk);
}

void ProgramEditor::revert() {
  File* file = current();
  if (file == nullptr || !file->modified()) return;
  file->text = file->saved_text;
  ++file->revision;
}

}  // namespace apron::ui
