// Source of program texts; tests and fuzzers replace the disk.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>

namespace apron::syntax {

class FileReader {
 public:
  virtual ~FileReader() = default;
  // The contents of a file, or nullopt if it does not exist, cannot be read or has more than
  // 16 MiB.
  virtual std::optional<std::string> read(const std::string& path) = 0;
};

class DiskReader final : public FileReader {
 public:
  DiskReader() = default;
  // Apart from the program only files whose real names end in .aps, so that no include shows the
  // lines of another file in a message.
  explicit DiskReader(std::string program) : program_(std::move(program)) {}
  std::optional<std::string> read(const std::string& path) override;

 private:
  std::optional<std::string> program_;
};

class MemoryReader final : public FileReader {
 public:
  std::map<std::string, std::string> files;
  std::optional<std::string> read(const std::string& path) override;
};

}  // namespace apron::syntax
