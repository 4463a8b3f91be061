"""What every request passes before its route: host, size, origin, identity, rate. It also turns errors into responses,
and holds what routes of the API and of the pages share."""
