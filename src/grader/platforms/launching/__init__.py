"""From a platform to this tool: logins, launches, deep linking and registration. Every message is verified here before
anything in it is believed."""
