// `apron fmt` on files.
#include "apron/run/cli/Commands.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace apron::run {
namespace {

class FormatCommandTest : public testing::Test {
 protected:
  void SetUp() override {
    file_ =
        (std::filesystem::path(testing::TempDir()) / ("fmt_" + std::to_string(getpid()) + ".aps")).string();
  }
  void TearDown() override { std::filesystem::remove(file_); }
  void write_text(const std::string& text) const { std::ofstream(file_) << text; }
  std::string read_text() const {
    std::ostringstream text;
    text << std::ifstream(file_).rdbuf();
    return text.str();
  }
  int format(bool write, bool only_check) {
    Options options;
    options.files = {file_};
    options.write = write;
    options.check_only = only_check;
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int status = format_programs(options);
    out_ = testing::internal::GetCapturedStdout();
    err_ = testing::internal::GetCapturedStderr();
    return status;
  }
  std::string file_, out_, err_;
};

TEST_F(FormatCommandTest, PrintsWritesOrChecks) {
  write_text("a=1\n");
  EXPECT_EQ(format(false, false), common::kDone);
  EXPECT_EQ(out_, "a = 1\n");
  EXPECT_EQ(format(false, true), common::kFailed);
  EXPECT_EQ(out_, file_ + "\n");
  EXPECT_EQ(read_text(), "a=1\n");
  EXPECT_EQ(format(true, false), common::kDone);
  EXPECT_EQ(read_text(), "a = 1\n");
  EXPECT_EQ(format(false, true), common::kDone);
  EXPECT_EQ(out_, "");
}

TEST_F(FormatCommandTest, KeepsInvalidFileAndReportsError) {
  write_text("a = 'open\n");
  EXPECT_EQ(format(true, false), common::kUserError);
  EXPECT_EQ(read_text(), "a = 'open\n");
  EXPECT_NE(err_.find(":1:5: error: this text has no closing quote"), std::string::npos) << err_;
}

}  // namespace
}  // namespace apron::run
