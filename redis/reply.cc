#include "redis/reply.h"

#include <hiredis/hiredis.h>

namespace terrace::redis {

void Reply::Free::operator()(redisReply* reply) const { ::freeReplyObject(reply); }

ReplyView::Kind ReplyView::kind() const {
  if (reply_ == nullptr) return Kind::kNil;
  switch (reply_->type) {
    case REDIS_REPLY_STRING:
    case REDIS_REPLY_STATUS:
      return Kind::kText;
    case REDIS_REPLY_INTEGER:
      return Kind::kInteger;
    case REDIS_REPLY_ARRAY:
      return Kind::kArray;
    case REDIS_REPLY_ERROR:
      return Kind::kError;
    default:
      return Kind::kNil;
  }
}

std::string_view ReplyView::text() const {
  if (kind() != Kind::kText && kind() != Kind::kError) return {};
  return {reply_->str, static_cast<std::size_t>(reply_->len)};
}

std::int64_t ReplyView::integer() const { return kind() == Kind::kInteger ? reply_->integer : 0; }

std::size_t ReplyView::size() const { return kind() == Kind::kArray ? reply_->elements : 0; }

ReplyView ReplyView::operator[](std::size_t at) const { return ReplyView(at < size() ? reply_->element[at] : nullptr); }

ReplyView ReplyView::Field(std::string_view name) const {
  for (std::size_t i = 0; i + 1 < size(); i += 2) {
    if ((*this)[i].text() == name) return (*this)[i + 1];
  }
  return ReplyView(nullptr);
}

}  // namespace terrace::redis
