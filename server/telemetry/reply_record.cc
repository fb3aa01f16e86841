#include "server/telemetry/reply_record.h"

#include "server/http/application.h"

namespace terrace::server {

ReplyRecord RecordOf(const SentReply& reply) {
  const Request& request = reply.request;
  const Response& response = reply.response;
  ReplyRecord record;
  record.method = request.method_name;
  record.target = request.target;
  record.status = response.status;
  record.body_bytes = reply.body_bytes;
  record.duration = reply.duration;
  record.route = response.labels.route;
  record.dataset = response.labels.subject;
  record.cache = response.labels.cache;
  record.error = response.labels.error;
  record.version = request.version;
  record.referer = request.fields->referer;
  record.user_agent = request.fields->user_agent;
  record.request_id = request.id;
  record.peer = reply.peer;
  return record;
}

}  // namespace terrace::server
