"""What UAVs of a team need to search together by radio: sectors, who takes which, what is known."""
