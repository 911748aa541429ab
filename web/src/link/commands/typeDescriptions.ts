// What services and types there are, as rosapi reports.

import type { TypeDefinition } from "../../lib/typeDefinitions.ts";
import { link } from "../link.ts";

export interface TypeAndService {
  name: string;
  /** As `std_srvs/srv/Trigger`. */
  type: string;
}

interface Described {
  typedefs: TypeDefinition[];
}

export async function serviceNames(): Promise<string[]> {
  const type = "rosapi_msgs/srv/Services";
  const answer = (await link.call("/rosapi/services", type, {})) as { services: string[] };
  return answer.services.sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
}

export async function serviceType(service: string): Promise<string> {
  const type = "rosapi_msgs/srv/ServiceType";
  const answer = (await link.call("/rosapi/service_type", type, { service })) as { type: string };
  return answer.type;
}

/** Definition of a request and of all that it is made of. */
export async function requestDefinitions(type: string): Promise<TypeDefinition[]> {
  return await described("service_request_details", "ServiceRequestDetails", type);
}

export async function messageDefinitions(type: string): Promise<TypeDefinition[]> {
  return await described("message_details", "MessageDetails", type);
}

async function described(name: string, srv: string, type: string): Promise<TypeDefinition[]> {
  const answer = await link.call(`/rosapi/${name}`, `rosapi_msgs/srv/${srv}`, { type });
  return (answer as Described).typedefs;
}
