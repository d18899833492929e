#include "apron/debugger/Listing.h"

#include <gtest/gtest.h>

#include "tests/unit/apron/debugger/TestSource.h"

namespace apron::debugger::test {
namespace {

const char* const kMain = R"(!include('lib.aps')
!register(A, B)
A = 1
B = twice(A)
B = four(B)
A = B
)";
const std::map<std::string, std::string> kFiles = {{"lib.aps", R"(// doubles
!macro_def
$y = twice($a)
!macro_begin
:t = $a + $a
$y = :t
!macro_end
!macro_def
$y = four($a)
!macro_begin
:half = twice($a)
$y = twice(:half)
!macro_end
)"}};

std::vector<std::string> row_texts(const Listing& listing) {
  std::vector<std::string> all;
  for (const Listing::Row& row : listing.rows()) all.push_back(std::string(row.depth, '>') + row.text);
  return all;
}
std::size_t find_row(const Listing& listing, const std::string& text) {
  for (std::size_t i = 0; i < listing.rows().size(); ++i)
    if (listing.rows()[i].text == text) return i;
  ADD_FAILURE() << "no row " << text;
  return 0;
}

TEST(Listing, FoldedListingShowsMainFile) {
  const CompiledSource c = compile(kMain, kFiles);
  const Listing listing(c.program, c.texts);
  EXPECT_EQ(row_texts(listing), (std::vector<std::string>{"!include('lib.aps')", "!register(A, B)", "A = 1",
                                                          "B = twice(A)", "B = four(B)", "A = B"}));
  EXPECT_EQ(listing.rows()[0].fold, Listing::Fold::kClosed);
  EXPECT_EQ(listing.rows()[2].fold, Listing::Fold::kNone);
  EXPECT_EQ(listing.rows()[3].fold, Listing::Fold::kClosed);
  EXPECT_FALSE(listing.rows()[1].has_code);
  for (const std::size_t row : {2, 3, 4, 5}) EXPECT_TRUE(listing.rows()[row].has_code) << row;
  // While folded, every instruction belongs to a line of the main file, in order.
  ASSERT_EQ(listing.groups().size(), c.program.code.size());
  EXPECT_TRUE(std::is_sorted(listing.groups().begin(), listing.groups().end()));
  EXPECT_EQ(listing.groups().front(), 2U);
  EXPECT_EQ(std::count(listing.groups().begin(), listing.groups().end(), 3U) > 0, true);
}

TEST(Listing, UnfoldsIncludesAndNestedMacros) {
  const CompiledSource c = compile(kMain, kFiles);
  Listing listing(c.program, c.texts);
  listing.toggle(0);
  EXPECT_EQ(listing.rows()[1].text, "lib.aps");  // the title, followed by the file's lines
  EXPECT_EQ(listing.rows()[1].line, 0U);
  EXPECT_EQ(listing.rows()[2].text, "// doubles");
  EXPECT_EQ(listing.rows()[2].depth, 1U);
  listing.toggle(0);
  EXPECT_EQ(listing.rows().size(), 6U);

  listing.toggle(find_row(listing, "B = four(B)"));
  ASSERT_EQ(row_texts(listing)[5], ">macro four, lib.aps");
  EXPECT_EQ(row_texts(listing)[6], ">:half = twice($a)");
  EXPECT_EQ(row_texts(listing)[7], ">$y = twice(:half)");
  EXPECT_EQ(listing.rows()[6].line, 11U);
  EXPECT_EQ(listing.rows()[6].fold, Listing::Fold::kClosed);
  listing.toggle(6);
  EXPECT_EQ(row_texts(listing)[7], ">>macro twice, lib.aps");
  EXPECT_EQ(row_texts(listing)[8], ">>:t = $a + $a");
  // The instructions belong to the unfolded lines, and none to the line above them.
  EXPECT_GT(std::count(listing.groups().begin(), listing.groups().end(), 8U), 0);
  EXPECT_EQ(std::count(listing.groups().begin(), listing.groups().end(), 4U), 0);
}

TEST(Listing, RevealsInstructionAndSumsProfileByRow) {
  const CompiledSource c = compile(kMain, kFiles);
  Listing listing(c.program, c.texts);
  std::vector<vm::InstructionProfile> profile(c.program.code.size(), {1, 10});
  std::uint64_t folded = 0, all = 0;
  for (const vm::InstructionProfile& row : listing.profile_by_row(profile)) all += row.executions;
  folded = listing.profile_by_row(profile)[4].executions;
  EXPECT_EQ(all, profile.size());
  const auto inside =
      std::find(listing.groups().begin(), listing.groups().end(), 4U) - listing.groups().begin();
  listing.reveal(static_cast<std::size_t>(inside));
  const std::size_t row = listing.groups()[static_cast<std::size_t>(inside)];
  EXPECT_EQ(listing.rows()[row].text, ":t = $a + $a");
  EXPECT_EQ(listing.rows()[row].depth, 2U);
  EXPECT_LT(listing.profile_by_row(profile)[row].executions, folded);
}

TEST(Listing, EmptyListing) {
  Listing listing;
  EXPECT_TRUE(listing.rows().empty());
  listing.toggle(3);
  listing.reveal(3);
  EXPECT_TRUE(Listing(program::Program{}, {}).rows().empty());
}

}  // namespace
}  // namespace apron::debugger::test
