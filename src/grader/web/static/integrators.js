export function openIntegrators() {}
